"""Warnings if the recorded missions say little about the designs."""

import csv
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path

from evoros.mission.mission import NOT_RUN
from evoros.storage.layout import MISSIONS

STILL = 0.1  # maximum distance of a robot at rest, relative to speed limit times duration
FIRST = 1000  # number of missions in which the distances of other robots are examined
CAUGHT = 0.8  # mean fraction of decisions that avoid something, above which a warning appears
_EASIER = "try an easier world or failure"
Row = Mapping[str, str]


def warn_not_run(folder: Path) -> str:
    """Return a warning if none of the recorded missions could be run, otherwise ""."""
    endings = Counter[tuple[str, str]]()
    for row in _read_missions(folder):
        if row["ended"] not in NOT_RUN:
            return ""
        endings[row["ended"], row["reason"]] += 1
    if not endings:
        return ""
    (ended, reason), _ = endings.most_common(1)[0]
    return (
        f"no mission could be run ({endings.total()} tried), so the fitness is meaningless; most "
        f"ended with {ended}: {reason or 'no reason is recorded'}"
    )


def list_doubts(folder: Path) -> list[str]:
    """Return warnings if no mission was run or completed, or if another robot did not move."""
    failed = warn_not_run(folder)
    if failed:
        return [failed]
    never = _warn_never_completed(_read_missions(folder))
    return [text for text in (never, *_warn_standing(_read_missions(folder))) if text]


def _warn_never_completed(rows: Iterable[Row]) -> str:
    missions, limits, farthest, avoiding = 0, 0, 0.0, 0.0
    for row in rows:
        if row["completed"] == "true":
            return ""
        missions += 1
        avoiding += float(row.get("avoiding") or 0.0)
        limits += row["ended"] == "time_limit"
        farthest = max(farthest, float(row["progress"]))
    if not missions:
        return ""
    fix = "raise time_limit_s of the course" if 2 * limits > missions else _EASIER
    if (share := avoiding / missions) > CAUGHT:
        fix = (
            f"{100 * share:.0f} % of the robots' decisions avoided something, perhaps a wall or "
            "the robot itself; draw a mission with evoros analyze mission, and lower the range "
            "of the avoidance"
        )
    return (
        f"no mission was completed ({missions} tried); the best reached {100 * farthest:.0f} % "
        f"of its course; {fix} if designs should complete missions"
    )


def _warn_standing(rows: Iterable[Row]) -> Iterator[str]:
    moving: Counter[str] = Counter()
    known: Counter[str] = Counter()
    for row in islice(rows, FIRST):
        for column in row:
            name, _, measure = column.rpartition(".")
            if name and measure == "distance_m" and row[f"{name}.ended"] not in NOT_RUN:
                most = float(row[f"{name}.max_speed_mps"]) * float(row[f"{name}.time_s"])
                known[name] += 1
                moving[name] += float(row[column]) > STILL * most
    for name, missions in known.items():
        if 2 * moving[name] < missions:
            yield (
                f"{name} stood still for most of the time in {missions - moving[name]} of "
                f"{missions} missions; draw such a mission with evoros analyze mission, and "
                "clear the robot's path"
            )


def _read_missions(folder: Path) -> Iterator[Row]:
    """Yield the rows of ``missions.csv`` until one is unreadable, which other code reports."""
    try:
        with (folder / MISSIONS).open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                if None in row.values():
                    return
                yield row
    except (OSError, ValueError, csv.Error):
        return
