"""Poses of a robot between the records of its trajectory, and positions of its wheels."""

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.formats.urdf.tree import Urdf

from ..tables.walkers import WalkerTrack

POSE = ("time_s", "x_m", "y_m", "yaw_rad")
_MIN_SPEED_MPS = 0.02  # slower wheels keep their direction


class Motion(NamedTuple):
    """The motion of a robot at n times of a mission."""

    time_s: Array  # (n,)
    x_m: Array
    y_m: Array
    yaw_rad: Array  # continuous
    record: NDArray[np.int64]  # (n,) index of the last record at or before the time
    joints: Mapping[str, Array]  # (n,) [rad], of the wheels and their steering

    def pose(self, index: int) -> tuple[float, float, float]:
        """Return x and y [m] and yaw [rad] at a time."""
        return float(self.x_m[index]), float(self.y_m[index]), float(self.yaw_rad[index])


def interpolate(trajectory: pd.DataFrame, times: Array, robot: Urdf) -> Motion:
    """Interpolate poses linearly; wheels steer and turn so that they roll."""
    check_poses(trajectory)
    # The end has a record of its own, even at the time of the previous record.
    distinct = trajectory.drop_duplicates("time_s", keep="last")
    time, x, y, yaw = (distinct[name].to_numpy(float) for name in POSE)
    yaw = np.unwrap(yaw)
    rates = [np.gradient(v, time) if len(time) > 1 else np.zeros(1) for v in (x, y, yaw)]
    twist = np.stack(
        [
            np.cos(yaw) * rates[0] + np.sin(yaw) * rates[1],
            np.cos(yaw) * rates[1] - np.sin(yaw) * rates[0],
            rates[2],
        ]
    )
    joints = {name: np.interp(times, time, angles) for name, angles in _joints(robot, time, twist)}
    all_times = trajectory["time_s"].to_numpy(float)
    return Motion(
        times,
        np.interp(times, time, x),
        np.interp(times, time, y),
        np.interp(times, time, yaw),
        np.searchsorted(all_times, times + 1e-9, side="right").astype(np.int64) - 1,
        joints,
    )


def interpolate_places(walker: WalkerTrack, times: Array) -> Array:
    """Interpolate the places (n, 2) [m] of a walker linearly."""
    columns = [np.interp(times, walker.time_s, column) for column in walker.places.T]
    return np.stack(columns, axis=1)


def check_poses(trajectory: pd.DataFrame, source: str = "trajectory") -> None:
    """Check that a trajectory has poses at increasing times; ``source`` names it in errors."""
    for name in (*POSE, "mode", "visited"):
        if name not in trajectory:
            raise InputError(f"{source}: must have the column {name}, but has not; restore it")
    if trajectory.empty:
        raise InputError(
            f"{source}: must have rows, but has none, because the mission could not be run; show "
            f"another"
        )
    numbers = trajectory[[*POSE]].to_numpy(float)
    for row in np.flatnonzero(~np.isfinite(numbers).all(axis=1)):
        raise InputError(
            f"{source}: must have a time and a place in each row, not {numbers[row].tolist()} in "
            f"row {row + 1}; restore it"
        )
    for row in np.flatnonzero(np.diff(numbers[:, 0]) < 0):
        raise InputError(
            f"{source}: time_s must not decrease, but does after row {row + 1}; restore it"
        )


def _joints(robot: Urdf, time: Array, twist: Array) -> Iterator[tuple[str, Array]]:
    """Yield the joints of wheels and their steering with their angles [rad] over time.

    Wheels have continuous joints with a horizontal axis, below vertical steering joints. ``twist``
    (3, n): forward and to the left [m/s], rate of turn [rad/s].
    """
    steps = np.diff(time, prepend=time[0])
    for name, joint in robot.joints.items():
        axis = robot.axis_of(joint)
        if joint.type != "continuous" or abs(axis[2]) > 0.1:
            continue
        x, y, radius = robot.poses[joint.child].position
        forward, aside = twist[0] - twist[2] * y, twist[1] + twist[2] * x
        speed = forward
        for above in robot.joints_above(joint.parent):
            upright = float(robot.axis_of(above)[2])
            if above.type != "fixed" and abs(upright) > 0.9:
                angle = _direction(forward, aside)
                signed = angle * math.copysign(1, upright)
                yield above.name, np.clip(signed, above.lower, above.upper)
                speed = np.cos(angle) * forward + np.sin(angle) * aside
        if radius > 0:
            yield name, np.cumsum(speed * steps) / radius * math.copysign(1, axis[1])


def _direction(forward: Array, aside: Array) -> Array:
    """Return the angle at which a wheel rolls, from -pi/2 to pi/2; it stays while it stands."""
    sign = np.copysign(1.0, forward)
    angle = np.arctan2(aside * sign, forward * sign)
    moving = np.hypot(forward, aside) >= _MIN_SPEED_MPS
    last = np.maximum.accumulate(np.where(moving, np.arange(len(angle)), -1))
    return np.where(last >= 0, angle[last], 0.0)
