"""The swing of the heading while a robot navigates: the serpentine of the paper."""

from itertools import pairwise

import numpy as np
import pandas as pd
from scipy.signal import find_peaks

from evoros.base.arrays import Array

from ..tables.records import Record

PROMINENCE_DEG = 3.0
"""Extremes of the heading with a smaller prominence are small corrections, no turning points."""
SETTLING = 1
"""Turning points dropped after a waypoint or an avoidance, while the robot turns to its course."""


def measure_swings(trajectory: pd.DataFrame, mode: int) -> list[float]:
    """Measure the swing of the heading about the course [deg] at each turning point.

    Stretches in ``mode`` between two waypoints count. A swing is the distance of an extreme from
    the mean of its two neighbours, so that a steady turn does not count: the swing of ``A sin(w t)
    + c t`` is ``2 A (1 + d^2 / 2)`` to second order in ``d = c / (A w)``.
    """
    yaw = np.degrees(np.unwrap(trajectory.yaw_rad.to_numpy(float)))
    if len(yaw) < 3:
        return []
    state = np.stack([trajectory["mode"].to_numpy() == mode, trajectory.visited.to_numpy()])
    changes = np.flatnonzero((state[:, 1:] != state[:, :-1]).any(axis=0)) + 1
    swings: list[float] = []
    for begin, end in pairwise([0, *changes.tolist(), len(yaw)]):
        if state[0, begin]:
            turns = _turning_points(yaw[begin:end])[SETTLING:]
            swings += np.abs(turns[1:-1] - (turns[:-2] + turns[2:]) / 2).tolist()
    return swings


def _turning_points(yaw: Array) -> Array:
    """Return the extreme headings of a stretch [deg], in order."""
    extremes = [find_peaks(sign * yaw, prominence=PROMINENCE_DEG)[0] for sign in (1, -1)]
    turns: Array = yaw[np.sort(np.concatenate(extremes))]
    return turns


def read_champion_swings(record: Record) -> pd.DataFrame:
    """Read ``world`` and ``swing_deg`` of each turning point while the last layer navigates."""
    rows = [
        (world, swing)
        for world in record.context.courses
        for swing in measure_swings(record.run.trajectory(world), len(record.context.modes))
    ]
    return pd.DataFrame(rows, columns=["world", "swing_deg"])
