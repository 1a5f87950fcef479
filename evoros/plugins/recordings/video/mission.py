"""Missions of champions prepared for filming, with all robots."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from evoros.analysis.drawing.faults import GROWN_S
from evoros.analysis.tables.agents import list_robots
from evoros.analysis.tables.champions import adapt_context
from evoros.analysis.tables.records import Record
from evoros.analysis.tables.tracks import PARTS, load_champion_world, read_track
from evoros.analysis.tables.walkers import WalkerTrack, list_walkers, read_walkers
from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.filter.protocol import ENDS, GROWS
from evoros.formats.urdf.tree import Urdf
from evoros.storage.figure_context import FigureContext
from evoros.storage.layout import ROBOT_AS_LOADED
from evoros.storage.verification import read_text
from evoros.world.model import World

POSE = ("time_s", "x_m", "y_m", "yaw_rad")
_MIN_SPEED_MPS = 0.02  # speed below which wheels keep their steering angles
Flags = NDArray[np.bool_]


class Motion(NamedTuple):
    """A robot's motion at n times during a mission."""

    time_s: Array  # (n,)
    x_m: Array
    y_m: Array
    yaw_rad: Array  # continuous, without jumps of 2 pi
    record: NDArray[np.int64]  # (n,) index of the last record at or before the time
    joints: Mapping[str, Array]  # angles (n,) [rad] by wheel or steering joint

    def pose(self, index: int) -> tuple[float, float, float]:
        """Return x, y [m] and yaw [rad] at one of the times."""
        return float(self.x_m[index]), float(self.y_m[index]), float(self.yaw_rad[index])


def interpolate(trajectory: pd.DataFrame, times: Array, robot: Urdf) -> Motion:
    """Interpolate poses linearly at times (n,) [s], and find the joint angles of rolling wheels."""
    check_poses(trajectory)
    # The end of the mission adds a record, possibly at the time of the previous one.
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


def check_poses(trajectory: pd.DataFrame, source: str = "trajectory") -> None:
    """Require that a trajectory has poses and non-decreasing times; errors name ``source``."""
    for name in (*POSE, "mode", "visited"):
        if name not in trajectory:
            raise InputError(f"{source}: no column {name}; restore the file")
    if trajectory.empty:
        raise InputError(
            f"{source}: no rows, because the mission could not be run; choose another mission"
        )
    numbers = trajectory[[*POSE]].to_numpy(float)
    for row in np.flatnonzero(~np.isfinite(numbers).all(axis=1)):
        raise InputError(
            f"{source}: row {row + 1} must have a time and a pose, not {numbers[row].tolist()}; "
            f"restore the file"
        )
    for row in np.flatnonzero(np.diff(numbers[:, 0]) < 0):
        raise InputError(f"{source}: time_s decreases after row {row + 1}; restore the file")


def _joints(robot: Urdf, time: Array, twist: Array) -> Iterator[tuple[str, Array]]:
    """Yield the wheel and steering joints with their angles [rad] over time.

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
    """Return a wheel's rolling direction, from -pi/2 to pi/2; at standstill, the previous one."""
    sign = np.copysign(1.0, forward)
    angle = np.arctan2(aside * sign, forward * sign)
    moving = np.hypot(forward, aside) >= _MIN_SPEED_MPS
    last = np.maximum.accumulate(np.where(moving, np.arange(len(angle)), -1))
    return np.where(last >= 0, angle[last], 0.0)


class ShownFault(NamedTuple):
    """A sensor fault in a mission."""

    sensor: int  # index, from 0
    at_s: float  # onset
    kind: str = ENDS  # effect on readings, one of ``FailureContext.effects``


def flag_ends(times: Array, count: int, faults: Sequence[ShownFault]) -> Flags:
    """Return flags (n, count), True at times [s] after a fault has ended a sensor's readings."""
    since = np.full(count, np.inf)
    for fault in faults:
        if fault.kind == ENDS:
            since[fault.sensor] = fault.at_s
    return np.asarray(times[:, None] >= since[None])


def measure_errors(times: Array, count: int, faults: Sequence[ShownFault]) -> Array:
    """Return the error to display (n, count), from 0 to 1, for each sensor at each time [s]."""
    shares = np.zeros((len(times), count))
    for fault in faults:
        if fault.kind == ENDS:
            continue
        since = np.asarray(times) - fault.at_s
        grown = np.clip(since / GROWN_S, 0.0, 1.0) if fault.kind == GROWS else 1.0 * (since >= 0)
        shares[:, fault.sensor] = np.maximum(shares[:, fault.sensor], grown)
    return shares


class OtherRobot(NamedTuple):
    """Another robot in a mission, filmed without sensors."""

    trajectory: pd.DataFrame
    urdf: str
    context: FigureContext


@dataclass(frozen=True, eq=False)
class FilmedMission:
    """A mission with the faults, robots and walkers that a film shows."""

    trajectory: pd.DataFrame
    """The columns of ``champion/trajectory_WORLD.csv`` or ``evoros.replay``."""
    urdf: str  # description of the robot that ran the mission, with its sensors
    world: World
    context: FigureContext
    faults: Sequence[ShownFault] = ()
    failed_parts: Sequence[tuple[float, str]] = ()  # time [s] and part name
    near_m: float | None = None  # range at which readings are marked; None: half of the maximum
    others: Sequence[OtherRobot] = ()
    walkers: Sequence[WalkerTrack] = ()


def read_mission(record: Record, world: str | None) -> tuple[str, FilmedMission]:
    """Read the champion's mission in the named world, or in the first world."""
    context = record.context
    name = world or next(iter(context.courses))
    if name not in context.courses:
        raise InputError(
            f"{record.path}: world {name!r} not found; choose one of {', '.join(context.courses)}"
        )
    mission = place_trajectory(record, name, _read_trajectory(record, name))
    track = read_track(record.run, context, name)
    others = [
        OtherRobot(_read_trajectory(other, name), _read_urdf(other), other.context)
        for other in list_robots(record)
        if other.agent != record.agent
    ]
    return name, replace(
        mission,
        faults=list(_list_faults(track, context.failure.effects)),
        failed_parts=list(_list_failed_parts(track)),
        others=others,
        walkers=read_walkers(record, name),
    )


def place_trajectory(record: Record, world: str, trajectory: pd.DataFrame) -> FilmedMission:
    """Return a champion's mission with this trajectory, without faults or other robots."""
    return FilmedMission(
        trajectory,
        _read_urdf(record),
        load_champion_world(record.run, record.context, world),
        adapt_context(record),
        near_m=find_near(record),
        walkers=list_walkers(trajectory, record.values),
    )


def find_near(record: Record) -> float | None:
    """Return the range [m] below which the controller avoids obstacles; None if it has none."""
    near_m = record.values.get("controller.avoidance.range_m")
    return float(near_m) if isinstance(near_m, int | float) else None


def _read_trajectory(record: Record, world: str) -> pd.DataFrame:
    trajectory = record.run.trajectory(world)
    check_poses(trajectory, f"{record.path / 'champion'}/trajectory_{world}.csv")
    return trajectory


def _read_urdf(record: Record) -> str:
    loaded = record.run.champion_file(ROBOT_AS_LOADED, record.agent)
    return read_text(loaded if loaded.exists() else loaded.with_name("robot.urdf"))


def _list_faults(track: pd.DataFrame, effects: Mapping[str, str]) -> Iterator[ShownFault]:
    columns = ("time_s", "failed_sensors", "failed_by")
    for time, sensors, names in zip(*(track[name] for name in columns), strict=True):
        for sensor, name in zip(str(sensors).split(";"), str(names).split(";"), strict=True):
            if sensor:
                yield ShownFault(int(sensor), float(time), effects.get(name, ENDS))


def _list_failed_parts(track: pd.DataFrame) -> Iterator[tuple[float, str]]:
    if PARTS[0] in track:
        for time, parts in zip(track["time_s"], track[PARTS[0]], strict=True):
            for part in filter(None, str(parts).split(";")):
                yield float(time), part
