"""The missions of evaluations, with the sensors that failed in them."""

import math
from collections.abc import Iterator

import pandas as pd

from evoros.base.errors import InputError
from evoros.failure.case import INTACT
from evoros.storage.tables import CASE

from .records import EvaluationRecord
from .study import Study
from .tracks import split_cell

KEYS = ("source", "design")
"""The columns that identify a design in an evaluation."""


def collect_missions(study: Study) -> pd.DataFrame:
    """Concatenate the missions of all evaluations, with marks of their failures.

    ``evaluation`` is the end of its path or, alone, its failure model; ``drawn`` says whether
    shares estimate a risk, ``intact`` whether no sensor was to fail.
    """
    _require_one_simulator(study)
    several = len(study.evaluations) > 1
    frames = [
        missions.assign(
            evaluation=record.name if several else record.choices.get("failure", record.name),
            drawn=record.context.failure.drawn & ~_is_stated(missions),
            intact=_find_intact(record, missions),
        )
        for record, missions in study.read_each(
            study.evaluations, lambda evaluation: evaluation.run.missions
        )
        if len(missions)
    ]
    if not frames:
        raise InputError(
            "worst: must be given evaluations, and there is none; make one with evoros evaluate "
            "designs=FOLDER failure=exhaustive trials=..."
        )
    table = pd.concat(frames, ignore_index=True).astype(dict.fromkeys(KEYS, str))
    failed = table["failed_sensors"].map(_write_set)
    return table.assign(failed_sensors=failed, failed_at_s=table["failed_at_s"].map(_first_time))


def count_sensors(record: EvaluationRecord) -> Iterator[tuple[tuple[str, str], int]]:
    """Yield the number of sensors of each design of an evaluation, by source and name."""
    for (source, design), mounts in record.mounts.groupby(list(KEYS), sort=False):
        yield (str(source), str(design)), int(mounts["sensor"].notna().sum())


def _is_stated(missions: pd.DataFrame) -> "pd.Series[bool]":
    """Whether each mission met a stated case, in an evaluation that looked for worst cases."""
    if CASE not in missions:
        return pd.Series(False, index=missions.index)
    return missions[CASE].notna()


def _find_intact(record: EvaluationRecord, missions: pd.DataFrame) -> "pd.Series[bool]":
    failure, stated = record.context.failure, _is_stated(missions)
    of_model = (missions["trial"].isin(failure.intact) | failure.always_intact) & ~stated
    return of_model | (stated & missions[CASE].eq(INTACT) if CASE in missions else stated)


def _require_one_simulator(study: Study) -> None:
    """Refuse evaluations in several simulators, whose missions tell nothing of one another."""
    simulators: dict[str, str] = {}
    for record in study.evaluations:
        for name in record.run.manifest.get("simulators", ())[:1]:  # without the confirming one
            simulators.setdefault(str(name), record.name)
    if len(simulators) > 1:
        given = ", ".join(f"{name} ({folder})" for name, folder in simulators.items())
        raise InputError(
            f"worst: must be given evaluations in one simulator, not in {given}; give those of one"
        )


def _write_set(cell: object) -> str:
    """Write the sensors that failed in increasing order; the file has them by semicolons."""
    return " ".join(map(str, sorted({int(float(part)) for part in split_cell(cell)})))


def _first_time(cell: object) -> float:
    return min(map(float, split_cell(cell)), default=math.nan)
