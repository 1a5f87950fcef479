"""The motion of a robot and the states of its sensors at the times of a video's pictures."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from evoros.analysis.drawing.faults import GROWN_S
from evoros.base.arrays import Array
from evoros.filter.protocol import ENDS, GROWS
from evoros.formats.urdf.tree import Urdf
from evoros.plugins.recordings.missions import ShownFault

_MIN_SPEED_MPS = 0.02  # speed below which wheels keep their steering angles
Flags = NDArray[np.bool_]


class Motion(NamedTuple):
    """The motion of a robot at n times of a mission."""

    time_s: Array  # (n,)
    x_m: Array
    y_m: Array
    yaw_rad: Array  # unwrapped, without jumps of 2 pi
    record: NDArray[np.int64]  # (n,) index of the last record up to each time
    joints: Mapping[str, Array]  # angles (n,) [rad] of each wheel and steering joint

    def pose(self, index: int) -> tuple[float, float, float]:
        """Return x, y [m] and yaw [rad] at a time index."""
        return float(self.x_m[index]), float(self.y_m[index]), float(self.yaw_rad[index])


def interpolate(trajectory: pd.DataFrame, times: Array, robot: Urdf) -> Motion:
    """Interpolate poses at times (n,) [s], and compute the joint angles of rolling wheels."""
    # The record at the end of a mission may repeat the time of the previous record.
    distinct = trajectory.drop_duplicates("time_s", keep="last")
    time, x, y, yaw = (
        distinct[name].to_numpy(float) for name in ("time_s", "x_m", "y_m", "yaw_rad")
    )
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


def _joints(robot: Urdf, time: Array, twist: Array) -> Iterator[tuple[str, Array]]:
    """Yield each wheel and steering joint with its angles [rad] over time.

    A wheel joint is continuous and has a horizontal axis; a steering joint above it has a vertical
    axis. ``twist`` (3, n) holds the forward and left velocities [m/s] and the yaw rate [rad/s].
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
    """Return the rolling direction of a wheel, -pi/2 to pi/2; at standstill, the previous one."""
    sign = np.copysign(1.0, forward)
    angle = np.arctan2(aside * sign, forward * sign)
    moving = np.hypot(forward, aside) >= _MIN_SPEED_MPS
    last = np.maximum.accumulate(np.where(moving, np.arange(len(angle)), -1))
    return np.where(last >= 0, angle[last], 0.0)


def flag_ends(times: Array, count: int, faults: Sequence[ShownFault]) -> Flags:
    """Return flags (n, count), True from the time [s] at which a fault silences a sensor."""
    since = np.full(count, np.inf)
    for fault in faults:
        if fault.kind == ENDS:
            since[fault.sensor] = fault.at_s
    return np.asarray(times[:, None] >= since[None])


def measure_errors(times: Array, count: int, faults: Sequence[ShownFault]) -> Array:
    """Return the error to display (n, count), 0 to 1, of each sensor at each time [s]."""
    shares = np.zeros((len(times), count))
    for fault in faults:
        if fault.kind == ENDS:
            continue
        since = np.asarray(times) - fault.at_s
        grown = np.clip(since / GROWN_S, 0.0, 1.0) if fault.kind == GROWS else 1.0 * (since >= 0)
        shares[:, fault.sensor] = np.maximum(shares[:, fault.sensor], grown)
    return shares
