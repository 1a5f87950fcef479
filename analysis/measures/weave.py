"""How far the heading swings while a robot navigates: the serpentine of the paper."""

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from evoros.types import Array

if TYPE_CHECKING:
    from ..tables.study import Record

PERIOD_S = 9.7  # of the original autopilot; where the configuration has none
SETTLING = 0.25  # periods left out after a waypoint or an avoidance: the turn back is no weave


def sweeps(trajectory: pd.DataFrame, mode: int, period_s: float = PERIOD_S) -> list[float]:
    """The peak-to-peak of the heading about the course [deg], one for each whole period.

    Of ``trajectory`` (columns as ``champion/trajectory_WORLD.csv``) all stretches in ``mode``
    without a waypoint that last two periods and ``SETTLING``. The course is the mean of the heading
    over a period around each moment: of a sine of that period it leaves the sine, of a straight
    drive or a steady turn nothing.
    """
    yaw = np.unwrap(trajectory.yaw_rad.to_numpy(float))
    times = trajectory.time_s.to_numpy(float)
    if len(times) < 3:
        return []
    samples = max(2, round(period_s / float(np.median(np.diff(times)))))
    state = np.stack([trajectory["mode"].to_numpy() == mode, trajectory.visited.to_numpy()])
    changes = np.flatnonzero((state[:, 1:] != state[:, :-1]).any(axis=0)) + 1
    found: list[float] = []
    for begin, end in pairwise([0, *changes.tolist(), len(yaw)]):
        settled = begin + int(SETTLING * samples)
        if state[0, begin] and end - settled >= 2 * samples:
            found += _peaks(yaw[settled:end], samples)
    return found


def _peaks(yaw: Array, samples: int) -> list[float]:
    course = np.convolve(yaw, np.full(samples, 1 / samples), "valid")
    about = yaw[samples // 2 : samples // 2 + len(course)] - course
    starts = range(0, len(about) - samples + 1, samples)
    return [float(np.degrees(np.ptp(about[i : i + samples]))) for i in starts]


def champion_sweeps(record: "Record") -> pd.DataFrame:
    """``world`` and ``sweep_deg``: a row a period of the champion's first missions.

    The last layer of the controller is the one that navigates.
    """
    period = record.values.get("controller.navigation.period_s", PERIOD_S)
    rows = [
        (world, sweep)
        for world in record.setting.courses
        for sweep in sweeps(record.run.trajectory(world), len(record.setting.modes), period)
    ]
    return pd.DataFrame(rows, columns=["world", "sweep_deg"])
