"""Designs whose missions a run has stored, with all data needed to replay the missions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import pandas as pd

from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext
from evoros.storage.trajectory_files import trajectory_file
from evoros.world.model import World

from . import designs, tracks
from .champions import adapt_context, find_shown, read_champion_sensors, read_champion_signals
from .records import Record
from .study import read_complete


class ShownMission(NamedTuple):
    """A stored mission."""

    row: "pd.Series[str]"  # the mission's row of ``missions.csv``
    trajectory: pd.DataFrame
    world: World
    ground: str  # key of the world; equal for missions in the same world


@dataclass(frozen=True, eq=False)
class ShownDesign:
    """A design of the first robot, its sensors, and one mission in each world."""

    record: Record
    design: int | str
    context: FigureContext  # includes the evolved sensor types
    sensors: pd.DataFrame
    signals: pd.DataFrame  # sensors without rays
    missions: Sequence[ShownMission]


def read_champion_shown(record: Record) -> ShownDesign:
    """Read the champion of a finished run."""
    worlds = tracks.load_champion_worlds(record.run, record.context)
    missions = [
        ShownMission(
            tracks.find_champion_mission(record.run, name), record.run.trajectory(name), world, name
        )
        for name, world in worlds.items()
    ]
    return ShownDesign(
        record,
        int(record.run.champion["design"].iloc[0]),
        adapt_context(record),
        read_champion_sensors(record),
        read_champion_signals(record),
        _require_rows(record, missions),
    )


def has_missions(record: Record, design: int) -> bool:
    """Return True if a run has stored the first missions of a design."""
    try:
        rows = [
            tracks.find_first_mission(record.run, design, world) for world in record.context.courses
        ]
    except InputError:
        return False
    return all(is_kept(record, row) for row in rows)


def keeps_shown(record: Record) -> bool:
    """Return True if a run is finished, or has stored the first missions of its best design."""
    try:
        design = read_complete(record, find_shown)
    except InputError:
        return False
    return design is None or has_missions(record, design)


def is_kept(record: Record, row: "pd.Series[str]") -> bool:
    """Return True if a run has stored the trajectory of a mission."""
    return (record.path / trajectory_file(tracks.find_key(row))).is_file()


def _read_kept(record: Record, row: "pd.Series[str]") -> ShownMission:
    trajectory = record.run.mission_trajectory(*tracks.find_key(row))
    world = tracks.load_mission_world(record.run, record.context, row)
    ground = f"{record.name}/{tracks.find_mission_world(record.run, row).stem}"
    return ShownMission(row, trajectory, world, ground)


def read_shown(
    record: Record,
    design: int,
    read_mission: Callable[[Record, "pd.Series[str]"], ShownMission] = _read_kept,
) -> ShownDesign:
    """Read any design of a run, with its first missions read by ``read_mission``."""
    names = record.context.courses
    missions = [
        read_mission(record, tracks.find_first_mission(record.run, design, name)) for name in names
    ]
    table = designs.read_generations(record)
    rows = table[table.id == design].iloc[-1:]
    context = designs.adapt_types(record.context, designs.read_evolved(record, design))
    return ShownDesign(
        record,
        design,
        context,
        designs.place_candidates(rows, record),
        designs.place_signals(designs.list_mounts(rows, record), context),
        _require_rows(record, missions),
    )


def _require_rows(record: Record, missions: Sequence[ShownMission]) -> list[ShownMission]:
    run = [mission for mission in missions if len(mission.trajectory)]
    if not run:
        raise InputError(f"{record.path}: none of the missions was run; choose another run")
    return run
