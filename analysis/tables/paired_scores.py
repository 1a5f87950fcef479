"""Designs with scores under two conditions, from evaluations or from runs with a confirmation."""

from collections.abc import Collection, Iterator, Mapping
from itertools import combinations
from math import nan
from typing import Any

import pandas as pd

from evoros.base.errors import InputError

from .candidates import read_generations
from .factors import TARGET, Values
from .matching import (
    CONFIRMING,
    apply_confirmation,
    find_differences,
    identify_champion,
    select_conditions,
)
from .records import Record
from .study import Study
from .treatments import SINGLE, label_treatments
from .validated import read_evaluations

COLUMNS = (
    *("between", "x", "y", "group", "source", "design"),
    *("x_fitness", "x_sd", "x_trials", "y_fitness", "y_sd", "y_trials", "change"),
)
Row = dict[str, Any]


def pair_scores(study: Study, between: str | None = None) -> pd.DataFrame:
    """Pair the scores of designs under two conditions: a row for each design and pair.

    The conditions are those of evaluations that differ in one part (``between``), of the only two
    evaluations, or the simulators of runs with a confirmation. Of several scores under the same
    conditions, those with the most trials count. ``docs/analysis.md`` describes the columns.
    """
    rows = list(_pair_evaluations(study)) or list(_pair_confirmations(study))
    parts = list(dict.fromkeys(str(row["between"]) for row in rows))
    if not parts:
        raise InputError(
            "no design has scores under two conditions; give two finished evaluations of the same "
            "designs that differ in one part (simulator, failure, world ...), or runs with a "
            "confirmation"
        )
    if between not in (None, *parts) or (between is None and len(parts) > 1):
        raise InputError(
            f"--between: must be one of {', '.join(parts)}, in which the evaluations differ, not "
            f"{between or 'left out'}; choose one"
        )
    table = pd.DataFrame([row for row in rows if row["between"] == (between or parts[0])])
    table = table.assign(trials=table[["x_trials", "y_trials"]].min(axis=1), order=table.index)
    best = table.sort_values("trials", ascending=False, kind="stable")
    best = best.drop_duplicates(["x", "y", "group", "content"]).sort_values("order")
    return best.assign(change=best["y_fitness"] - best["x_fitness"])[list(COLUMNS)]


def _pair_evaluations(study: Study) -> Iterator[Row]:
    """Pair the designs that are in both of two evaluations whose conditions differ in one part."""
    evaluations = read_evaluations(study) if len(study.evaluations) > 1 else []
    conditions = [select_conditions(evaluation) for evaluation, _ in evaluations]
    choices = [apply_confirmation(evaluation.choices) for evaluation, _ in evaluations]
    treatments = _champion_treatments(study)
    for i, j in combinations(range(len(evaluations)), 2):
        parts = dict.fromkeys(map(first_key, find_differences(conditions[i], conditions[j])))
        if len(parts) != 1 and len(evaluations) > 2:
            continue
        others = {first_key(key) for values in conditions for key in values} - set(parts)
        names = label_treatments([_only(values, parts) for values in conditions], choices)
        groups = label_treatments([_only(values, others) for values in conditions], choices)
        if not parts:  # the evaluations differ in their draws or trials
            names = [evaluation.name for evaluation, _ in evaluations]
        if names.index(names[i]) > names.index(names[j]):  # all pairs have the same axes
            i, j = j, i
        pair = {"between": " and ".join(parts) or "draws", "x": names[i], "y": names[j]}
        for row in join_designs(evaluations[i][1], evaluations[j][1]):
            group = treatments.get(row["content"], "") if groups[i] == SINGLE else groups[i]
            yield {**pair, "group": group, **row}


def join_designs(x: pd.DataFrame, y: pd.DataFrame) -> Iterator[Row]:
    """Join the scores of the designs that are in both tables."""
    scores = {row["content"]: row for row in y.to_dict("records")}
    for row in x.drop_duplicates("content").to_dict("records"):
        if row["content"] in scores:
            yield {
                **{name: row[name] for name in ("content", "source", "design")},
                **_prefix("x", row),
                **_prefix("y", scores[row["content"]]),
            }


def _prefix(side: str, row: Mapping[Any, Any]) -> Row:
    names = {"fitness": "fitness", "sd": "fitness_sd", "trials": "trials"}
    return {f"{side}_{short}": row[name] for short, name in names.items()}


def _champion_treatments(study: Study) -> dict[Any, str]:
    """Map the champions of the runs in the study to the treatments of the runs."""
    treatments = {}
    for record in study.records:
        try:
            treatments[identify_champion(record)] = record.treatment
        except InputError:
            continue  # not finished; none of its designs is drawn here
    return treatments


def _pair_confirmations(study: Study) -> Iterator[Row]:
    confirmed = [record for record in study.records if f"{CONFIRMING}.{TARGET}" in record.values]
    if confirmed:
        table = study.keep(confirmed).gather(_read_confirmed)
        yield from ({str(k): v for k, v in row.items()} for row in table.to_dict("records"))


def _read_confirmed(record: Record) -> pd.DataFrame:
    """Read the confirmed designs of a run."""
    table = read_generations(record)
    confirmed = table[table["loss"].notna()].drop_duplicates("id")
    simulators = [
        _only(values, {"simulator"}) for values in (record.values, select_conditions(record))
    ]
    x, y = label_treatments(simulators, [record.choices, apply_confirmation(record.choices)])
    return pd.DataFrame(
        {
            **{"between": "simulator", "x": x, "y": y, "group": record.treatment},
            **{"source": record.name, "design": confirmed["id"]},
            "content": [(record.name, design) for design in confirmed["id"]],
            **{"x_fitness": confirmed["screened_fitness"], "y_fitness": confirmed["fitness"]},
            **{"x_sd": nan, "y_sd": nan},
            **dict.fromkeys(("x_trials", "y_trials"), record.values.get("trials")),
        }
    )


def first_key(key: str) -> str:
    """Return the part of the configuration that a dotted key is in."""
    return key.split(".")[0]


def _only(values: Values, parts: Collection[str]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if first_key(key) in parts}
