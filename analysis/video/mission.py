"""Missions of champions as films show them, with all their robots."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import pandas as pd

from evoros.base.errors import InputError
from evoros.filter.protocol import ENDS
from evoros.storage.figure_context import FigureContext
from evoros.storage.layout import ROBOT_AS_LOADED
from evoros.storage.verification import read_text
from evoros.world.model import World

from ..tables.agents import list_robots
from ..tables.champions import adapt_context
from ..tables.records import Record
from ..tables.tracks import PARTS, load_champion_world, read_track
from ..tables.walkers import WalkerTrack, list_walkers, read_walkers
from .faults import ShownFault
from .motion import check_poses


class OtherRobot(NamedTuple):
    """Another robot of a mission, which is shown without its sensors."""

    trajectory: pd.DataFrame
    urdf: str
    context: FigureContext


@dataclass(frozen=True, eq=False)
class FilmedMission:
    """A mission as a film shows it."""

    trajectory: pd.DataFrame
    """The columns of ``champion/trajectory_WORLD.csv`` or ``evoros.replay``."""
    urdf: str  # the robot that ran it, with its sensors
    world: World
    context: FigureContext
    faults: Sequence[ShownFault] = ()  # of its sensors
    failed_parts: Sequence[tuple[float, str]] = ()  # time [s] and name
    near_m: float | None = None  # lower readings are marked; None: half the sensor's range
    others: Sequence[OtherRobot] = ()
    walkers: Sequence[WalkerTrack] = ()


def read_mission(record: Record, world: str | None) -> tuple[str, FilmedMission]:
    """Read the champion's mission in the named world, or in the first."""
    context = record.context
    name = world or next(iter(context.courses))
    if name not in context.courses:
        raise InputError(f"{record.path}: must have the world {name!r}, but has not; give another")
    mission = place_trajectory(record, name, _read_trajectory(record, name))
    track = read_track(record.run, context, name)
    faults = _list_faults(track, context.failure.effects)
    others = [
        OtherRobot(_read_trajectory(other, name), _read_urdf(other), other.context)
        for other in list_robots(record)
        if other.agent != record.agent
    ]
    parts = list(_list_failed_parts(track))
    walkers = read_walkers(record, name)
    mission = replace(mission, faults=list(faults), failed_parts=parts)
    return name, replace(mission, others=others, walkers=walkers)


def place_trajectory(record: Record, world: str, trajectory: pd.DataFrame) -> FilmedMission:
    """Return a mission of the champion by its trajectory, without faults and other robots."""
    return FilmedMission(
        trajectory,
        _read_urdf(record),
        load_champion_world(record.run, record.context, world),
        adapt_context(record),
        near_m=find_near(record),
        walkers=list_walkers(trajectory, record.values),
    )


def find_near(record: Record) -> float | None:
    """Return the range [m] from which on the controller avoids, if it does."""
    near_m = record.values.get("controller.avoidance.range_m")
    return float(near_m) if isinstance(near_m, int | float) else None


def _read_trajectory(record: Record, world: str) -> pd.DataFrame:
    trajectory = record.run.trajectory(world)
    check_poses(trajectory, f"{record.path / 'champion'}/trajectory_{world}.csv")
    return trajectory


def _read_urdf(record: Record) -> str:
    loaded = record.robot_folder / ROBOT_AS_LOADED
    return read_text(loaded if loaded.exists() else record.robot_folder / "robot.urdf")


def _list_faults(track: pd.DataFrame, effects: Mapping[str, str]) -> Iterator[ShownFault]:
    """List the faults of a mission, by the records of its track; ``effects`` tell their kinds."""
    columns = ("time_s", "failed_sensors", "failed_by")
    for time, sensors, names in zip(*(track[name] for name in columns), strict=True):
        for sensor, name in zip(str(sensors).split(";"), str(names).split(";"), strict=True):
            if sensor:
                yield ShownFault(int(sensor), float(time), effects.get(name, ENDS))


def _list_failed_parts(track: pd.DataFrame) -> Iterator[tuple[float, str]]:
    """List the times [s] at which other parts failed, with the parts."""
    if PARTS[0] in track:
        for time, parts in zip(track["time_s"], track[PARTS[0]], strict=True):
            for part in filter(None, str(parts).split(";")):
                yield float(time), part
