"""Designs with scores under two conditions, from evaluations or from confirmed runs."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import combinations, pairwise
from math import nan
from typing import Any

import pandas as pd

from evoros.base.errors import InputError

from .designs import read_generations
from .factors import TARGET, Values
from .records import Record
from .study import Study
from .treatments import SINGLE, label_treatments
from .validated import (
    CONFIRMING,
    Scores,
    apply_confirmation,
    find_differences,
    identify_champion,
    read_evaluations,
    select_conditions,
)

NAMES = ("source", "design")  # names of a design on the lowest rung of a ladder
COLUMNS = (
    *("between", "x", "y", "group", "source", "design"),
    *("x_fitness", "x_sd", "x_trials", "y_fitness", "y_sd", "y_trials", "change"),
)
Row = dict[str, Any]


def pair_scores(study: Study, between: str | None = None) -> pd.DataFrame:
    """Pair the scores of designs under two conditions: one row per design and pair.

    The conditions come from evaluations that differ in one part (``between``), from the only two
    evaluations, or from runs with a confirmation. The scores with the most trials count.
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
        wrong = f", but not in {between}" if between else ""
        raise InputError(
            f"--between: the evaluations differ in {', '.join(parts)}{wrong}; choose one part"
        )
    table = pd.DataFrame([row for row in rows if row["between"] == (between or parts[0])])
    table = table.assign(trials=table[["x_trials", "y_trials"]].min(axis=1), order=table.index)
    best = table.sort_values("trials", ascending=False, kind="stable")
    best = best.drop_duplicates(["x", "y", "group", "content"]).sort_values("order")
    return best.assign(change=best["y_fitness"] - best["x_fitness"])[list(COLUMNS)]


def _pair_evaluations(study: Study) -> Iterator[Row]:
    evaluations = read_evaluations(study) if len(study.evaluations) > 1 else []
    conditions = [select_conditions(evaluation) for evaluation, _ in evaluations]
    choices = [apply_confirmation(evaluation.choices) for evaluation, _ in evaluations]
    treatments = _champion_treatments(study)
    for i, j in combinations(range(len(evaluations)), 2):
        parts = dict.fromkeys(map(_first_key, find_differences(conditions[i], conditions[j])))
        if len(parts) != 1 and len(evaluations) > 2:
            continue
        others = {_first_key(key) for values in conditions for key in values} - set(parts)
        names = label_treatments([_only(values, parts) for values in conditions], choices)
        groups = label_treatments([_only(values, others) for values in conditions], choices)
        if not parts:  # the evaluations differ in draws or trials
            names = [evaluation.name for evaluation, _ in evaluations]
        if names.index(names[i]) > names.index(names[j]):  # gives all pairs the same axes
            i, j = j, i
        pair = {"between": " and ".join(parts) or "draws", "x": names[i], "y": names[j]}
        for row in _join_designs(evaluations[i][1], evaluations[j][1]):
            group = treatments.get(row["content"], "") if groups[i] == SINGLE else groups[i]
            yield {**pair, "group": group, **row}


def _join_designs(x: pd.DataFrame, y: pd.DataFrame) -> Iterator[Row]:
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
    treatments = {}
    for record in study.records:
        try:
            treatments[identify_champion(record)] = record.treatment
        except InputError:
            continue  # unfinished runs have no champion
    return treatments


def _pair_confirmations(study: Study) -> Iterator[Row]:
    confirmed = [record for record in study.records if f"{CONFIRMING}.{TARGET}" in record.values]
    if confirmed:
        table = study.keep(confirmed).gather(_read_confirmed)
        yield from ({str(k): v for k, v in row.items()} for row in table.to_dict("records"))


def _read_confirmed(record: Record) -> pd.DataFrame:
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


def _first_key(key: str) -> str:
    return key.split(".")[0]


def _only(values: Values, parts: Collection[str]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if _first_key(key) in parts}


def climb(study: Study) -> pd.DataFrame:
    """Pair the designs' scores on each rung with the scores on the next; see ``COLUMNS``.

    Rungs are evaluations in the given order; designs that are missing on a rung are reported.
    """
    rungs = read_evaluations(study) if len(study.evaluations) > 1 else []
    if len(rungs) < 2:
        raise InputError(
            "--ladder: needs two or more finished evaluations of the same designs, from "
            "the lowest rung to the highest; add their folders"
        )
    contents = [set(scores["content"]) for _, scores in rungs]
    common = set.intersection(*contents)
    if not common:
        raise InputError(
            "--ladder: no design is in all evaluations; evaluate the same designs on each rung"
        )
    missing = len(set.union(*contents)) - len(common)
    if missing:
        study.report(f"{missing} designs are not in all evaluations")
    table = pd.DataFrame(_pair_rungs(rungs, _name_rungs(rungs)))
    table = table[[content in common for content in table["content"]]]
    first = rungs[0][1].drop_duplicates("content").set_index("content")
    table = table.assign(**{name: table["content"].map(first[name]) for name in NAMES})
    return table.assign(change=table["y_fitness"] - table["x_fitness"])[list(COLUMNS)]


def _name_rungs(rungs: Sequence[Scores]) -> list[str]:
    conditions = [select_conditions(evaluation) for evaluation, _ in rungs]
    choices = [apply_confirmation(evaluation.choices) for evaluation, _ in rungs]
    keys = [key for values in conditions[1:] for key in find_differences(conditions[0], values)]
    parts = dict.fromkeys(map(_first_key, keys))
    for labels in (
        [", ".join(filter(None, map(chosen.get, parts))) for chosen in choices],
        label_treatments(conditions, choices),
    ):
        if len(set(labels)) == len(labels):
            return labels
    return [evaluation.name for evaluation, _ in rungs]


def _pair_rungs(rungs: Sequence[Scores], names: Sequence[str]) -> Iterator[dict[str, Any]]:
    conditions = [select_conditions(evaluation) for evaluation, _ in rungs]
    steps = zip(pairwise(rungs), pairwise(names), pairwise(conditions), strict=True)
    for ((_, lower), (_, upper)), (x, y), (one, other) in steps:
        parts = dict.fromkeys(map(_first_key, find_differences(one, other)))
        between = " and ".join(parts) or "draws"
        for row in _join_designs(lower, upper):
            yield {"between": between, "x": x, "y": y, "group": "", **row}
