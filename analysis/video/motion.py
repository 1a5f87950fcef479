"""Where a robot is between the records of its trajectory, and how its wheels stand."""

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.formats.urdf.tree import Urdf

POSE = ("time_s", "x_m", "y_m", "yaw_rad")
_SLOW_MPS = 0.02  # below, the direction of a wheel's velocity says nothing


class Motion(NamedTuple):
    """At some times of a mission."""

    time_s: Array  # (n,)
    x_m: Array
    y_m: Array
    yaw_rad: Array  # without jumps
    record: NDArray[np.int64]  # (n,) number of the last record so far
    joints: Mapping[str, Array]  # (n,) [rad], of the wheels


def motion(trajectory: pd.DataFrame, times: Array, robot: Urdf) -> Motion:
    """Poses are interpolated linearly; wheels steer and turn so that they roll.

    ``trajectory`` has at least the columns ``POSE``.

    Raises:
        InputError: a number of them is missing, or time does not increase.
    """
    check_poses(trajectory)
    # The end has a record of its own, also where it is the time of the last reading.
    own = trajectory.drop_duplicates("time_s", keep="last")
    time, x, y, yaw = (own[name].to_numpy(float) for name in POSE)
    yaw = np.unwrap(yaw)
    rates = [np.gradient(each, time) if len(time) > 1 else np.zeros(1) for each in (x, y, yaw)]
    twist = np.stack(
        [
            np.cos(yaw) * rates[0] + np.sin(yaw) * rates[1],
            np.cos(yaw) * rates[1] - np.sin(yaw) * rates[0],
            rates[2],
        ]
    )
    joints = {name: np.interp(times, time, angles) for name, angles in _wheels(robot, time, twist)}
    all_times = trajectory["time_s"].to_numpy(float)
    return Motion(
        times,
        np.interp(times, time, x),
        np.interp(times, time, y),
        np.interp(times, time, yaw),
        np.searchsorted(all_times, times + 1e-9, side="right").astype(np.int64) - 1,
        joints,
    )


def check_poses(trajectory: pd.DataFrame, source: str = "trajectory") -> None:
    """Raises ``InputError`` for a trajectory that leads nowhere; ``source`` names it."""
    for name in (*POSE, "mode", "visited"):
        if name not in trajectory:
            raise InputError(f"{source}: must have the column {name}, and has not; restore it")
    if trajectory.empty:
        raise InputError(
            f"{source}: must have rows, and has none, for the mission was not flown; show another"
        )
    numbers = trajectory[[*POSE]].to_numpy(float)
    for row in np.flatnonzero(~np.isfinite(numbers).all(axis=1)):
        raise InputError(
            f"{source}: must have a time and a place in each row, not {numbers[row].tolist()} in "
            f"row {row + 1}; restore it"
        )
    for row in np.flatnonzero(np.diff(numbers[:, 0]) < 0):
        raise InputError(
            f"{source}: time_s must not decrease, as it does behind row {row + 1}; restore it"
        )


def _wheels(robot: Urdf, time: Array, twist: Array) -> Iterator[tuple[str, Array]]:
    """Joints of wheels, and of what steers them, with their positions over time.

    A wheel is what turns without limit about an axis that lies level; what steers it is a joint
    above it that stands upright. ``twist`` (3, n): velocity forward, to the left [m/s] and rate of
    turn [rad/s] of the robot.
    """
    steps = np.diff(time, prepend=time[0])
    for name, joint in robot.joints.items():
        axis = robot.axis_of(joint)
        if joint.type != "continuous" or abs(axis[2]) > 0.1:
            continue
        x, y, radius = robot.poses[joint.child].position
        ahead, aside = twist[0] - twist[2] * y, twist[1] + twist[2] * x
        speed = ahead
        for above in robot.joints_above(joint.parent):
            upright = float(robot.axis_of(above)[2])
            if above.type != "fixed" and abs(upright) > 0.9:
                angle = _direction(ahead, aside)
                yield (
                    above.name,
                    np.clip(angle * math.copysign(1, upright), above.lower, above.upper),
                )
                speed = np.cos(angle) * ahead + np.sin(angle) * aside
        if radius > 0:
            yield name, np.cumsum(speed * steps) / radius * math.copysign(1, axis[1])


def _direction(ahead: Array, aside: Array) -> Array:
    """Into which a wheel must point to roll, from -90 to 90 degrees; kept while it stands."""
    back = np.copysign(1.0, ahead)
    angle = np.arctan2(aside * back, ahead * back)
    moving = np.hypot(ahead, aside) >= _SLOW_MPS
    last = np.maximum.accumulate(np.where(moving, np.arange(len(angle)), -1))
    return np.where(last >= 0, angle[last], 0.0)
