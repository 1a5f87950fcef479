"""Scores of designs, and missions, paired between two conditions or versions."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import combinations, pairwise
from math import nan
from typing import Any

import numpy as np
import pandas as pd

from evoros.base.errors import InputError, write_count
from evoros.mission.plan import MOST_REPEATS, VALIDATION
from evoros.storage.layout import name_parts, replay_command

from .designs import read_generations
from .factors import TARGET, Values, format_value
from .records import EvaluationRecord, Record
from .study import Study, read_complete
from .treatments import SINGLE, label_treatments
from .validated import (
    CONFIRMING,
    Scores,
    apply_confirmation,
    find_differences,
    identify_champion,
    is_within,
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
    evaluations, or from runs with a confirmation. Of several scores, the one with the most trials
    is used.
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
        if not parts:  # the evaluations differ only in draws or trials
            names = [evaluation.name for evaluation, _ in evaluations]
        if names.index(names[i]) > names.index(names[j]):  # makes all pairs use the same axes
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
    """Pair the scores of designs on each rung (evaluation) with the next rung; see ``COLUMNS``."""
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
        study.report(f"{write_count(missing, 'design')} not in all evaluations")
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


COMPLETED, PROGRESS, TIME, COLLISIONS = "completed", "progress", "completion_time_s", "collisions"
# Quantities to compare, most important first, with the sign of an improvement.
QUANTITIES: Mapping[str, int] = {COMPLETED: 1, PROGRESS: 1, COLLISIONS: -1, TIME: -1}
# Keys, or prefixes of keys, that determine random draws, and others without effect on missions.
DRAWN_BY = ("seed", "evaluation_draws", "world", "failure")
FREE = ("executor", "figures", "record", "trials", "optimizer", "requirements", "treatment")
CHAMPION = "champion"
LOST, GAINED, WORSE, BETTER, SAME = "lost", "gained", "worse", "better", "same"

SLIGHT = 0.01  # relative difference up to which completion times count as equal


def find_pair(study: Study) -> tuple[Record, Record]:
    """Return the two runs or evaluations to compare, both finished and with the same draws."""
    records = study.evaluations or study.given  # both versions may have used the same configuration
    if len(records) != 2 or (study.evaluations and study.records):
        names = ", ".join(record.name for record in (*study.evaluations, *study.records))
        raise InputError(
            f"regression: needs two evaluations or two runs, but found {names or 'none'}; "
            f"type: evoros analyze regression BEFORE AFTER"
        )
    one, other = records
    for record in records:
        record.require_finished()
    differing = find_differences(one.values, other.values)
    for key in (key for top in DRAWN_BY for key in differing if is_within(key, top)):
        values = [format_value(record.values.get(key, "absent")) for record in records]
        raise InputError(
            f"{other.path / 'config.yaml'}: {key} is {values[1]}, but {values[0]} in {one.path}, "
            f"so the random draws differ; repeat one of the two with the {key} of the other"
        )
    first, second = (record.run.manifest.get("sha256", {}) for record in records)
    for name in find_differences(first, second):
        if name.startswith("world."):
            raise InputError(
                f"{other.path}: the file of {name} differs from the one used in {one.path}; "
                f"repeat one of the two with the file of the other"
            )
    return one, other


def list_changes(one: Record, other: Record) -> list[str]:
    """List the parts of the configuration that differ between two folders."""
    keys = find_differences(one.values, other.values)
    return list(dict.fromkeys(key.split(".")[0] for key in keys if key.split(".")[0] not in FREE))


def pair_missions(study: Study, one: Record, other: Record) -> pd.DataFrame:
    """Pair missions with the same draws: one row per pair, worst change first."""
    first, second = (read_complete(record, read_missions) for record in (one, other))
    first, second = _name_designs(study, (one, first), (other, second))
    key = ["design", "world", "trial"]
    table = first.merge(second, on=key, suffixes=("_a", "_b"), validate="one_to_one")
    if table.empty:
        raise InputError(
            f"{other.path}: no mission has the same design, world and trial as a mission of "
            f"{one.name}; evaluate the same designs"
        )
    differing = table[table["draws_a"] != table["draws_b"]]
    if len(differing):
        row = differing.iloc[0]
        raise InputError(
            f"{other.path}: trial {row['trial']} in {row['world']} has the draws "
            f"{row['draws_b']}, but {row['draws_a']} in {one.name}; repeat it with the same seed "
            f"and numbers of trials"
        )
    changes = pd.DataFrame(
        {
            name: sign * (table[f"{name}_b"] - table[f"{name}_a"])
            for name, sign in QUANTITIES.items()
        }
    )
    slight = changes[TIME].abs() <= SLIGHT * table[f"{TIME}_a"]
    changes[TIME] = changes[TIME].mask(slight, 0.0)
    order = changes.fillna(0.0).sort_values(list(QUANTITIES), kind="stable").index
    columns = [f"{name}_{side}" for name in QUANTITIES for side in "ab"]
    table["change"] = [_name_change(row) for row in changes.to_dict("records")]
    replays = ["replay_a", "replay_b"]
    return table.loc[order, [*key, "change", *columns, *replays]].reset_index(drop=True)


def _name_change(row: Mapping[Any, float]) -> str:
    signs = [int(np.sign(value)) for value in row.values() if value == value]
    changed = next((sign for sign in signs if sign), 0)
    if row[COMPLETED]:
        return GAINED if changed > 0 else LOST
    return {0: SAME, 1: BETTER, -1: WORSE}[changed]


def read_missions(record: Record) -> pd.DataFrame:
    """Read the missions of an evaluation, or the validation of a run's champion."""
    missions = record.run.missions
    if isinstance(record, EvaluationRecord):
        columns = ["source", "design", "world", "trial"]
        searched = "worst_cases.most" in record.values  # the worst-case search adds later trials
        chosen = missions[missions["trial"] < MOST_REPEATS] if searched else missions
    else:
        columns = ["generation", "design", "world", "trial", "purpose"]
        number = int(record.run.champion["design"].iloc[0])
        of_champion = missions["purpose"].eq(VALIDATION) & missions["design"].eq(number)
        chosen = missions[of_champion]
    if chosen.empty:
        raise InputError(
            f"{record.path}: no missions on fresh draws were found; evaluate the champion "
            f"with evoros evaluate"
        )
    done, parts = chosen["completed"].astype(bool), name_parts(record.path)
    return pd.DataFrame(
        {
            "source": chosen["source"].astype(str) if "source" in chosen else CHAMPION,
            "design": chosen["design"].astype(str),
            "world": chosen["world"].astype(str),
            "trial": chosen["trial"].astype(int),
            "draws": chosen["draws"].astype(str),
            COMPLETED: done.astype(int),
            PROGRESS: chosen["progress"].astype(float),
            COLLISIONS: chosen["collisions"].astype(float),
            TIME: chosen["time_s"].astype(float).where(done),
            "replay": [
                replay_command(record.path, row, parts)
                for row in chosen[columns].to_dict("records")
            ],
        }
    )


Missions = tuple[Record, pd.DataFrame]


def _name_designs(
    study: Study, first: Missions, second: Missions
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Match designs by name (single designs always match); rename them, and drop all others."""
    tables = []
    for _, table in (first, second):
        ambiguous = table.groupby("design")["source"].transform("nunique") > 1
        qualified = table["design"] + " of " + table["source"]
        tables.append(table.assign(design=table["design"].mask(ambiguous, qualified)))
    names = [list(dict.fromkeys(table["design"])) for table in tables]
    if list(map(len, names)) == [1, 1]:
        tables[1] = tables[1].assign(design=names[0][0])
    else:
        for (record, _), of_record, others in zip((first, second), names, names[::-1], strict=True):
            for name in of_record:
                if name not in others:
                    study.report(f"{record.path}: design {name} is in this folder only")
    one, other = (table.drop(columns="source") for table in tables)
    return one, other
