"""Missions of two evaluations or two runs, paired by random draws, one row per pair."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from evoros.base.errors import InputError
from evoros.mission.plan import MOST_REPEATS, VALIDATION
from evoros.storage.layout import name_parts, replay_command

from .factors import format_value
from .records import EvaluationRecord, Record
from .study import Study, read_complete
from .validated import find_differences, is_within

COMPLETED, PROGRESS, TIME, COLLISIONS = "completed", "progress", "completion_time_s", "collisions"
# Quantities to compare, most important first, with the sign of a better change.
QUANTITIES: Mapping[str, int] = {COMPLETED: 1, PROGRESS: 1, COLLISIONS: -1, TIME: -1}
# Keys, or prefixes of keys, that determine random draws, and that do not affect missions.
DRAWN_BY = ("seed", "evaluation_draws", "world", "failure")
FREE = ("executor", "figures", "record", "trials", "optimizer", "requirements", "treatment")
CHAMPION = "champion"
LOST, GAINED, WORSE, BETTER, SAME = "lost", "gained", "worse", "better", "same"

SLIGHT = 0.01  # maximum relative difference in completion times that counts as unchanged


def find_pair(study: Study) -> tuple[Record, Record]:
    """Return the two finished folders of a study, whose missions must have the same draws."""
    records = study.evaluations or study.given  # both versions may have run the same configuration
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
    """List the parts of the configuration in which two folders differ."""
    keys = find_differences(one.values, other.values)
    return list(dict.fromkeys(key.split(".")[0] for key in keys if key.split(".")[0] not in FREE))


def pair_missions(study: Study, one: Record, other: Record) -> pd.DataFrame:
    """Pair the missions with the same draws: one row per pair, the worst change first."""
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
    """Read the missions of an evaluation's designs, or those that validate a run's champion."""
    missions = record.run.missions
    if isinstance(record, EvaluationRecord):
        columns = ["source", "design", "world", "trial"]
        searched = "worst_cases.most" in record.values  # the search adds later trials
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
    """Match designs by name, or single designs; name them alike, and drop all others."""
    tables = [table.assign(design=list(_qualify(table))) for _, table in (first, second)]
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


def _qualify(table: pd.DataFrame) -> Iterator[str]:
    sources = table.groupby("design")["source"].nunique()
    for design, source in zip(table["design"], table["source"], strict=True):
        yield design if sources[design] == 1 else f"{design} of {source}"
