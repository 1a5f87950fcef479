"""How far the heading swings while a robot navigates: the serpentine of the paper."""

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.signal import find_peaks

from evoros.base.arrays import Array

if TYPE_CHECKING:
    from ..tables.records import Record

PROMINENCE_DEG = 3.0
"""What stands out less from the heading around it is no turning point but a small correction."""
SETTLING = 1
"""Turning points left out after a waypoint or an avoidance: the turn onto the course is none."""


def sweeps(trajectory: pd.DataFrame, mode: int) -> list[float]:
    """How far the heading swings about the course [deg]: one number for each turning point.

    Of ``trajectory`` (columns as ``champion/trajectory_WORLD.csv``) all stretches in ``mode``
    without a waypoint. A turning point is a greatest or least heading; its sweep is its distance
    from the mean of its two neighbours, so that neither the period of the weave need be known, nor
    does a steady turn count: of ``A sin(w t) + c t`` it is ``2 A (1 + d^2 / 2)`` to second order
    in ``d = c / (A w)``.
    """
    yaw = np.degrees(np.unwrap(trajectory.yaw_rad.to_numpy(float)))
    if len(yaw) < 3:
        return []
    state = np.stack([trajectory["mode"].to_numpy() == mode, trajectory.visited.to_numpy()])
    changes = np.flatnonzero((state[:, 1:] != state[:, :-1]).any(axis=0)) + 1
    found: list[float] = []
    for begin, end in pairwise([0, *changes.tolist(), len(yaw)]):
        if state[0, begin]:
            turns = _turning_points(yaw[begin:end])[SETTLING:]
            found += np.abs(turns[1:-1] - (turns[:-2] + turns[2:]) / 2).tolist()
    return found


def _turning_points(yaw: Array) -> Array:
    """The greatest and least headings of a stretch [deg], in their order."""
    ends = [find_peaks(side * yaw, prominence=PROMINENCE_DEG)[0] for side in (1, -1)]
    turns: Array = yaw[np.sort(np.concatenate(ends))]
    return turns


def champion_sweeps(record: "Record") -> pd.DataFrame:
    """``world`` and ``sweep_deg``: a row a turning point of the champion's first missions.

    The last layer of the controller is the one that navigates.
    """
    rows = [
        (world, sweep)
        for world in record.setting.courses
        for sweep in sweeps(record.run.trajectory(world), len(record.setting.modes))
    ]
    return pd.DataFrame(rows, columns=["world", "sweep_deg"])
