"""Walkers in recorded missions: their tracks, and the robots that touched them."""

import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.formats.sdf.actors import HEIGHT_M, RADIUS_M
from evoros.mission.mission import WALKER
from evoros.walkers.crowd import has_touched

from .agents import list_robots
from .champions import find_shown
from .records import Record
from .tracks import read_mission

COLUMNS = ("world", "walker", "radius_m", "time_s", "x_m", "y_m", "touched_by")


class WalkerTrack(NamedTuple):
    """The track of a walker in a mission."""

    name: str
    radius_m: float
    height_m: float
    time_s: Array
    places: Array  # (n, 2) [m]
    touched_by: Array  # (n,) sum of 2**i over the robots i that the walker has touched so far

    def find_touch(self, robot: int) -> int | None:
        """Return the index at which the robot first touched the walker, or None."""
        touched = [has_touched(report, robot) for report in self.touched_by.tolist()]
        return touched.index(True) if any(touched) else None


def list_walkers(trajectory: pd.DataFrame, values: Mapping[str, Any]) -> list[WalkerTrack]:
    """List the walkers of a mission; ``values`` is the configuration of its run."""
    tracks = []
    time = trajectory["time_s"].to_numpy(float)
    for column in map(str, trajectory.columns):
        match = re.fullmatch(rf"{re.escape(WALKER)}(.+)\.x_m", column)
        if match is None or trajectory[column].isna().all():
            continue
        name = match[1]
        columns = [f"{WALKER}{name}.{part}" for part in ("x_m", "y_m", "touched_by")]
        numbers = trajectory[columns].to_numpy(float)
        size = _find_size(values, name)
        tracks.append(WalkerTrack(name, *size, time, numbers[:, :2], numbers[:, 2]))
    return tracks


def _find_size(values: Mapping[str, Any], name: str) -> tuple[float, float]:
    group = name.rpartition("_")[0]
    # Actors, and groups that the configuration lacks, have the size of a person.
    radius = values.get(f"walkers.{group}.radius_m", RADIUS_M)
    height = values.get(f"walkers.{group}.height_m", HEIGHT_M)
    return float(radius), float(height)


def read_walkers(record: Record, world: str) -> list[WalkerTrack]:
    """Read the walkers in the champion's mission shown for a world."""
    whole = list_robots(record)[0]
    _, trajectory = read_mission(whole.run, world, find_shown(record))
    return list_walkers(trajectory, record.values)


def to_table(walkers: Mapping[str, Iterable[WalkerTrack]]) -> pd.DataFrame:
    """Return a table, with ``COLUMNS``, of the walkers' tracks in each world."""
    parts = [
        pd.DataFrame(
            {
                "world": world,
                "walker": walker.name,
                "radius_m": walker.radius_m,
                "time_s": walker.time_s,
                "x_m": walker.places[:, 0],
                "y_m": walker.places[:, 1],
                "touched_by": walker.touched_by.astype(np.int64),
            }
        )
        for world, tracks in walkers.items()
        for walker in tracks
    ]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=[*COLUMNS])
