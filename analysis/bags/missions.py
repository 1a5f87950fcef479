"""Recorded missions of all robots in them, for other software."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.formats.strict_xml import parse
from evoros.formats.urdf.parts import Joint, read_joint
from evoros.formats.urdf.tree import read_tree
from evoros.geometry.shapes import Pose
from evoros.mission.plan import count_round
from evoros.storage.figure_context import FigureContext
from evoros.storage.layout import ROBOT_AS_LOADED
from evoros.storage.trajectory_files import loaded_robot_file, robot_file, trajectory_file
from evoros.storage.verification import read_text
from evoros.world.model import World

from ..tables.agents import select_agent
from ..tables.candidates import read_evolved
from ..tables.champions import adapt_context
from ..tables.designs import adapt_types
from ..tables.readings import RecordedSensor, read_sensors
from ..tables.records import Record
from ..tables.tracks import find_champion_mission, load_champion_world, load_mission_world
from ..tables.walkers import WalkerTrack, list_walkers

_LARGEST = 1e9
"""No number of a mission exceeds it, and messages have room for it."""


@dataclass(frozen=True, eq=False)
class RecordedMission:
    """A mission as it was recorded."""

    name: str  # WORLD, or GENERATION_DESIGN_WORLD_TRIAL
    row: "pd.Series[str]"  # of ``missions.csv``
    context: FigureContext  # with the types of sensors as they evolved
    trajectory: pd.DataFrame  # with the columns of ``trajectory_WORLD.csv``
    urdf: str  # the robot with its sensors
    loaded_urdf: str  # as engines load it
    joints: Sequence[Joint]  # of ``urdf``
    root: str  # its root link
    root_pose: Pose  # of the root link in the frame that the trajectory is of
    sensors: Sequence[RecordedSensor]
    world: World
    route: Array  # (legs, 2) waypoints in order [m]
    modes: Sequence[str]  # by their number in the trajectory, from 1
    others: Mapping[str, "RecordedMission"] = field(default_factory=dict)
    """The same mission as each other robot in its world has it, by the robot's name."""
    walkers: Sequence[WalkerTrack] = ()


def read_champion_mission(record: Record, world: str) -> RecordedMission:
    """Read the champion's first mission in a world."""
    row, context = find_champion_mission(record.run, world), adapt_context(record)
    files = _Files(
        world,
        record.path / "champion" / f"trajectory_{world}.csv",
        record.robot_folder / "robot.urdf",
        record.robot_folder / ROBOT_AS_LOADED,
    )
    scene = load_champion_world(record.run, record.context, world), context
    mission = _assemble(record, row, files, record.run.trajectory(world), scene)
    return replace(mission, others=_read_others(record, read_champion_mission, world))


def _read_others(
    record: Record, read: Callable[[Record, Any], RecordedMission], mission: Any
) -> dict[str, RecordedMission]:
    return {name: read(select_agent(record, name), mission) for name in record.context.agents}


def read_mission(record: Record, row: "pd.Series[str]") -> RecordedMission:
    """Read the mission in a row of ``missions.csv`` of a run that keeps all trajectories."""
    generation, design, trial = (int(row[name]) for name in ("generation", "design", "trial"))
    key = (generation, design, str(row["world"]), trial)
    file, agent = trajectory_file(key), record.agent
    files = _Files(
        f"{generation:05d}_{file.stem}",
        record.path / file,
        record.path / robot_file(design, agent),
        record.path / loaded_robot_file(design, agent),
    )
    context = adapt_types(record.context, read_evolved(record, design))
    scene = load_mission_world(record.run, record.context, row), context
    mission = _assemble(record, row, files, record.run.mission_trajectory(*key), scene)
    return replace(mission, others=_read_others(record, read_mission, row))


class _Files(NamedTuple):
    """The name of a mission, and the files that it is read from."""

    mission: str
    trajectory: Path
    described: Path  # the robot
    loaded: Path  # as engines load it; missing if that is as it is described


def _assemble(
    record: Record,
    row: "pd.Series[str]",
    files: _Files,
    trajectory: pd.DataFrame,
    scene: tuple[World, FigureContext],
) -> RecordedMission:
    """Put a mission together; the types of sensors in the context are as they evolved."""
    (world, context), agent = scene, record.agent
    _check(trajectory, files.trajectory, context)
    urdf, source = read_text(files.described), str(files.described)
    loaded = read_text(files.loaded) if files.loaded.is_file() else urdf
    elements = parse(urdf.encode(), source)
    # Not as a tree: a described robot may have meshes, which only what engines load has as shapes.
    links = [str(link.get("name")) for link in elements.findall("link")]
    joints = [read_joint(joint, links) for joint in elements.findall("joint")]
    root = next(iter({*links} - {joint.child for joint in joints}))
    rng = generator(str(row["draws"]), f"agents.{agent}.course" if agent else "course")
    round_index = count_round(str(row["purpose"]), int(row["generation"]), int(row["trial"]))
    return RecordedMission(
        name=files.mission,
        row=row,
        context=context,
        trajectory=trajectory,
        urdf=urdf,
        loaded_urdf=loaded,
        joints=joints,
        root=root,
        root_pose=Pose() if loaded == urdf else _find_root(root, loaded, files.loaded),
        sensors=read_sensors(trajectory, links, context, source),
        world=world,
        route=world.course.route(world.course.goes_forward(round_index, rng)),
        modes=context.modes,
        walkers=list_walkers(trajectory, record.values),
    )


def _check(trajectory: pd.DataFrame, source: Path, context: FigureContext) -> None:
    if trajectory.empty:
        raise InputError(
            f"{source}: must have rows, but has none, because the mission could not be run; "
            f"choose another"
        )
    numbers = ("time_s", "x_m", "y_m", "yaw_rad", "speed_mps", "steering_rad", "mode", "visited")
    if trajectory[[*numbers]].isna().to_numpy().any() or (trajectory["time_s"].diff() < 0).any():
        raise InputError(
            f"{source}: must have numbers in all cells but readings, and times that increase; "
            f"restore the file"
        )
    recorded = trajectory.select_dtypes("number")
    far = (recorded.abs() > _LARGEST).to_numpy().any()
    if far or len(recorded.columns) < len(trajectory.columns) or (trajectory["visited"] < 0).any():
        raise InputError(
            f"{source}: must have numbers alone, of at most {_LARGEST:g}, and at least 0 "
            f"waypoints visited; restore the file"
        )
    if not trajectory["mode"].between(0, len(context.modes)).all():
        raise InputError(
            f"{source}: mode must be from 0 to {len(context.modes)}, the modes of setting.json, "
            f"not {trajectory['mode'].max():g}; restore the files"
        )


def _find_root(root: str, loaded: str, source: Path) -> Pose:
    """Return the pose of the root link in the frame of the trajectory, which engines may add."""
    return read_tree(parse(loaded.encode(), source.name), str(source)).poses.get(root, Pose())


def list_rows(
    record: Record, generation: int | None, design: int | None, trial: int | None
) -> Iterator["pd.Series[str]"]:
    """Yield the rows of ``missions.csv`` of a design, in order; of the champion without one."""
    missions = record.run.missions
    if design is None:
        design = int(
            find_champion_mission(record.run, next(iter(record.context.courses)))["design"]
        )
    chosen = missions[missions["design"] == design]
    for column, wanted in (("generation", generation), ("trial", trial)):
        if wanted is not None:
            chosen = chosen[chosen[column] == wanted]
    if chosen.empty:
        raise InputError(
            f"{record.path / 'missions.csv'}: must have a mission of design {design} with the "
            f"given generation and trial, but has none; correct --design, --generation or --trial"
        )
    for _, row in chosen.iterrows():
        yield row
