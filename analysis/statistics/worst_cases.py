"""Failures that stop a design: cases of failed sensors, sets of them, and their risk."""

import math
from collections.abc import Mapping
from typing import Any

import pandas as pd

from ..tables.failed_missions import KEYS
from .small_samples import share_interval

CASES = (*KEYS, "failed_sensors", "failed", "failed_at_s", "missions", "stopped", "stopped_in")
SETS = (*KEYS, "sensors", "failed", "sets", "of", "stopping", "missions", "stopped")
RISKS = (*KEYS, "evaluation", "world", "missions", "stopped", "risk", "risk_low", "risk_high")


def list_cases(missions: pd.DataFrame) -> pd.DataFrame:
    """List the cases that the missions have met, with ``CASES`` as columns.

    A case is the set of sensors that failed, and the time of the first failure [s], NaN if none
    failed. It stops a design in the worlds in which one of its missions was not completed.
    """
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
    """Count, by design and number of failed sensors, the sets met and those that stop it.

    ``sensors`` has the number of sensors of each design; ``docs/analysis.md`` describes ``SETS``.
    """
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
    """Estimate the probability that a mission is not completed, for failures that are drawn.

    ``world`` is empty for all together, where a trial fails if one mission does. The interval is
    Wilson's.
    """
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
    """Return the cases with the fewest failed sensors, one at least, that stop a design."""
    stopping = cases[(cases["stopped"] > 0) & (cases["failed"] > 0)]
    smallest: pd.DataFrame = stopping[stopping["failed"] == stopping["failed"].min()]
    return smallest


def read_set(failed: str) -> tuple[int, ...]:
    """Read the numbers of the sensors in the column ``failed_sensors``."""
    return tuple(map(int, failed.split())) if failed else ()


def _share(count: int, total: int) -> tuple[float, ...]:
    interval = share_interval(count, total)
    return total, count, count / total, interval.low, interval.high
