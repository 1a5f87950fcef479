"""Sensor failures that stop a design: cases, sets of failed sensors, risks."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from evoros.base.errors import InputError
from evoros.failure.protocol import INTACT
from evoros.storage.tables import CASE

from ..tables.records import EvaluationRecord
from ..tables.study import Study
from ..tables.tracks import split_cell
from .small_samples import share_interval

KEYS = ("source", "design")  # columns that identify a design of an evaluation


def collect_missions(study: Study) -> pd.DataFrame:
    """Concatenate the missions of all evaluations, and classify their failures.

    Columns ``drawn`` (random failures, to estimate risks) and ``intact`` (none) are added.
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
            "worst: the folders contain no evaluation; make one with evoros evaluate "
            "like=FOLDER failure=exhaustive trials=..."
        )
    table = pd.concat(frames, ignore_index=True).astype(dict.fromkeys(KEYS, str))
    numbers = [
        sorted({int(float(part)) for part in split_cell(cell)}) for cell in table["failed_sensors"]
    ]
    times = [min(map(float, split_cell(cell)), default=math.nan) for cell in table["failed_at_s"]]
    failed = pd.Series([" ".join(map(str, some)) for some in numbers], table.index, dtype=str)
    return table.assign(failed_sensors=failed, failed_at_s=times)


def count_sensors(record: EvaluationRecord) -> Iterator[tuple[tuple[str, str], int]]:
    """Yield each design of an evaluation as (source, name), with its number of sensors."""
    for (source, design), mounts in record.mounts.groupby(list(KEYS), sort=False):
        yield (str(source), str(design)), int(mounts["sensor"].notna().sum())


def _is_stated(missions: pd.DataFrame) -> "pd.Series[bool]":
    if CASE not in missions:
        return pd.Series(False, index=missions.index)
    return missions[CASE].notna()


def _find_intact(record: EvaluationRecord, missions: pd.DataFrame) -> "pd.Series[bool]":
    stated = _is_stated(missions)
    of_model = ~stated & record.context.failure.always_intact
    return of_model | missions[CASE].eq(INTACT) if CASE in missions else of_model


def _require_one_simulator(study: Study) -> None:
    simulators: dict[str, str] = {}
    for record in study.evaluations:
        # the second simulator, if any, is used only for confirmation
        for name in record.run.manifest.get("simulators", ())[:1]:
            simulators.setdefault(str(name), record.name)
    if len(simulators) > 1:
        given = ", ".join(f"{name} ({folder})" for name, folder in simulators.items())
        raise InputError(
            f"worst: needs evaluations in one simulator, but they are in {given}; name the folders "
            f"of one simulator"
        )


CASES = (*KEYS, "failed_sensors", "failed", "failed_at_s", "missions", "stopped", "stopped_in")
SETS = (*KEYS, "sensors", "failed", "sets", "of", "stopping", "missions", "stopped")
RISKS = (*KEYS, "evaluation", "world", "missions", "stopped", "risk", "risk_low", "risk_high")


def list_cases(missions: pd.DataFrame) -> pd.DataFrame:
    """List each set of failed sensors with the time [s] of the first failure, or NaN."""
    rows = []
    missions = missions[missions["intact"] | (missions["failed_sensors"] != "")]
    by = missions.groupby([*KEYS, "failed_sensors", "failed_at_s"], dropna=False, sort=False)
    for (source, design, failed, time), met in by:
        lost = met[~met["completed"].astype(bool)]
        worlds = " ".join(dict.fromkeys(lost["world"].astype(str)))
        count = len(read_set(str(failed)))
        rows.append((source, design, failed, count, time, len(met), len(lost), worlds))
    table = pd.DataFrame(rows, columns=list(CASES))
    order = [*KEYS, "failed", "failed_sensors", "failed_at_s"]
    return table.sort_values(order, kind="stable", ignore_index=True)


def count_sets(cases: pd.DataFrame, sensors: Mapping[tuple[str, str], int]) -> pd.DataFrame:
    """Count the sets tested and the sets that stop a design, by number of failed sensors."""
    rows = []
    for (source, design), tested in cases.groupby(list(KEYS), sort=False):
        total = sensors[str(source), str(design)]
        for failed, met in tested.groupby("failed"):
            sets = met.groupby("failed_sensors")["stopped"].sum()
            every = math.comb(total, len(read_set(str(sets.index[0]))))
            counts = len(sets), every, int((sets > 0).sum())
            flown = int(met["missions"].sum()), int(met["stopped"].sum())
            rows.append((source, design, total, failed, *counts, *flown))
    return pd.DataFrame(rows, columns=list(SETS))


def estimate_risks(missions: pd.DataFrame) -> pd.DataFrame:
    """Estimate the risk of random failures in each world, and for trials over all worlds."""
    rows: list[tuple[Any, ...]] = []
    drawn = missions[missions["drawn"]]
    for (source, design, evaluation), tested in drawn.groupby([*KEYS, "evaluation"], sort=False):
        for world, flown in tested.groupby("world", sort=False):
            lost = int((~flown["completed"].astype(bool)).sum())
            rows.append((source, design, evaluation, world, *_share(lost, len(flown))))
        whole = tested.groupby("trial")["completed"].all()
        rows.append((source, design, evaluation, "", *_share(int((~whole).sum()), len(whole))))
    return pd.DataFrame(rows, columns=list(RISKS))


def find_smallest(cases: pd.DataFrame) -> pd.DataFrame:
    """Return the cases with the fewest failed sensors (at least one) that stop a design."""
    stopping = cases[(cases["stopped"] > 0) & (cases["failed"] > 0)]
    smallest: pd.DataFrame = stopping[stopping["failed"] == stopping["failed"].min()]
    return smallest


def read_set(failed: str) -> tuple[int, ...]:
    """Parse the sensor numbers in a cell of ``failed_sensors``."""
    return tuple(map(int, failed.split())) if failed else ()


def _share(count: int, total: int) -> tuple[float, ...]:
    interval = share_interval(count, total)
    return total, count, count / total, interval.low, interval.high
