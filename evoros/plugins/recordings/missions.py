"""Recorded missions with all robots, and the options that select missions for export."""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from evoros.analysis.subcommands import add_run, add_worlds
from evoros.analysis.tables import readings, tracks
from evoros.analysis.tables.agents import list_robots, select_agent
from evoros.analysis.tables.champions import adapt_context
from evoros.analysis.tables.designs import adapt_types, read_evolved
from evoros.analysis.tables.records import Record
from evoros.analysis.tables.shown import is_kept
from evoros.analysis.tables.study import Study
from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.filter.protocol import ENDS
from evoros.formats.strict_xml import parse
from evoros.formats.urdf.parts import Joint, read_joint
from evoros.formats.urdf.tree import read_tree
from evoros.geometry.shapes import Pose
from evoros.mission.plan import count_round
from evoros.storage.figure_context import FigureContext
from evoros.storage.layout import ROBOT_AS_LOADED
from evoros.storage.trajectory_files import loaded_robot_file, robot_file, trajectory_file
from evoros.storage.verification import read_text
from evoros.terminal.log import LOGGER
from evoros.world.model import World

_MAX_VALUE = 1e9  # maximum absolute value of numbers in a mission, which must fit into messages
_REQUIRED = ("time_s", "x_m", "y_m", "yaw_rad", "speed_mps", "steering_rad", "mode", "visited")


class ShownFault(NamedTuple):
    """A sensor fault in a mission."""

    sensor: int  # index, from 0
    at_s: float  # onset
    kind: str = ENDS  # effect on readings, one of ``FailureContext.effects``


@dataclass(frozen=True, eq=False)
class RecordedMission:
    """A recorded mission, centred on one robot."""

    trajectory: pd.DataFrame  # table with the columns of ``trajectory_WORLD.csv``
    urdf: str  # robot description with sensors
    loaded_urdf: str  # robot description that engines load
    world: World
    context: FigureContext  # context that includes evolved parameters of sensor types
    joints: Sequence[Joint]
    root: str  # root link
    root_pose: Pose  # pose of the root link in the frame whose poses the trajectory records
    sensors: Sequence[readings.RecordedSensor]
    name: str = ""  # WORLD, or GENERATION_DESIGN_WORLD_TRIAL
    route: Array = field(default_factory=lambda: np.empty((0, 2)))  # (legs, 2) [m], as driven
    faults: Sequence[ShownFault] = ()
    part_failures: Sequence[tuple[str, float, str]] = ()  # part, onset [s] and effect
    near_m: float | None = None  # range of highlighted readings; None for half the maximum
    others: Mapping[str, "RecordedMission"] = field(default_factory=dict)  # same mission, by name
    walkers: Sequence[readings.WalkerTrack] = ()


def assemble(
    trajectory: pd.DataFrame,
    urdf: str,
    world: World,
    context: FigureContext,
    loaded_urdf: str = "",
    sources: tuple[str, str] = ("trajectory", "robot.urdf"),
    **more: Any,
) -> RecordedMission:
    """Check a trajectory and a robot description, and assemble the mission.

    ``loaded_urdf`` is the description that engines load, if different. ``sources`` are the files of
    the trajectory and the description, for errors; ``more`` holds the other fields.
    """
    _check(trajectory, sources[0], len(context.modes))
    elements = parse(urdf.encode(), sources[1])
    # ``read_tree`` rejects meshes, which are replaced only in the loaded description
    links = [str(link.get("name")) for link in elements.findall("link")]
    joints = [read_joint(joint, links) for joint in elements.findall("joint")]
    root = next(iter({*links} - {joint.child for joint in joints}))
    root_pose = Pose()  # engines may insert a link above the root
    if loaded_urdf:
        tree = read_tree(parse(loaded_urdf.encode(), ROBOT_AS_LOADED), ROBOT_AS_LOADED)
        root_pose = tree.poses.get(root, root_pose)
    sensors = readings.read_sensors(trajectory, links, context, sources[1])
    robot = urdf, loaded_urdf or urdf, world, context, joints, root, root_pose, sensors
    return RecordedMission(trajectory, *robot, **more)


def read_champion_mission(record: Record, world: str) -> RecordedMission:
    """Read the champion's first mission in a world, including all robots."""
    robots = {robot.agent: place_champion(robot, world) for robot in list_robots(record)}
    mission = robots.pop(record.agent)
    return replace(mission, others=robots, walkers=readings.read_walkers(record, world))


def place_champion(
    record: Record, world: str, trajectory: pd.DataFrame | None = None
) -> RecordedMission:
    """Return a champion's first mission in a world, or the mission with the given trajectory."""
    files = (
        record.run.champion_file(f"trajectory_{world}.csv"),
        record.run.champion_file("robot.urdf", record.agent),
        record.run.champion_file(ROBOT_AS_LOADED, record.agent),
    )
    row = tracks.find_champion_mission(record.run, world)
    shown = tracks.load_champion_world(record.run, record.context, world), adapt_context(record)
    recorded = record.run.trajectory(world) if trajectory is None else trajectory
    return _assemble(record, row, files, recorded, shown, name=world)


def read_mission(record: Record, row: "pd.Series[str]") -> RecordedMission:
    """Read the mission of a row in ``missions.csv`` from a run that recorded all trajectories."""
    generation, design, trial = (int(row[name]) for name in ("generation", "design", "trial"))
    key = (generation, design, str(row["world"]), trial)
    file, agent = trajectory_file(key), record.agent
    files = file, robot_file(design, agent), loaded_robot_file(design, agent)
    trajectory = record.run.mission_trajectory(*key)
    shown = (
        tracks.load_mission_world(record.run, record.context, row),
        adapt_types(record.context, read_evolved(record, design)),
    )
    return _assemble(
        record,
        row,
        [record.path / file for file in files],
        trajectory,
        shown,
        name=f"{generation:05d}_{file.stem}",
        walkers=readings.list_walkers(trajectory, record.values),
        others={
            name: read_mission(select_agent(record, name), row) for name in record.context.agents
        },
    )


def _assemble(
    record: Record,
    row: "pd.Series[str]",
    files: Sequence[Path],
    trajectory: pd.DataFrame,
    shown: tuple[World, FigureContext],
    **more: Any,
) -> RecordedMission:
    """Assemble a mission from its trajectory, the robot, and the robot that engines loaded."""
    source, described, loaded = files
    world, context = shown
    urdf = read_text(described)
    loaded_urdf = read_text(loaded) if loaded.is_file() else ""
    rng = generator(
        str(row["draws"]), f"agents.{record.agent}.course" if record.agent else "course"
    )
    round_index = count_round(str(row["purpose"]), int(row["generation"]), int(row["trial"]))
    near = record.values.get("controller.avoidance.range_m")
    effects = context.failure.effects
    return assemble(
        trajectory,
        urdf,
        world,
        context,
        loaded_urdf * (loaded_urdf != urdf),
        (str(source), str(described)),
        route=world.course.route(world.course.goes_forward(round_index, rng)),
        faults=[
            ShownFault(sensor, time, effects.get(effect, ENDS))
            for sensor, time, effect in tracks.list_failures(row)
        ],
        part_failures=tracks.list_part_failures(row),
        near_m=float(near) if isinstance(near, int | float) else None,
        **more,
    )


def _check(trajectory: pd.DataFrame, source: str, modes: int) -> None:
    for name in _REQUIRED:
        if name not in trajectory:
            raise InputError(f"{source}: no column {name}; restore the file")
    if trajectory.empty:
        raise InputError(
            f"{source}: no rows, because the mission could not be run; choose another mission"
        )
    for row in np.flatnonzero(trajectory[[*_REQUIRED]].isna().any(axis=1)):
        raise InputError(f"{source}: row {row + 1} has an empty cell; restore the file")
    for row in np.flatnonzero(np.diff(trajectory["time_s"]) < 0):
        raise InputError(f"{source}: time_s decreases after row {row + 1}; restore the file")
    recorded = trajectory.select_dtypes("number")
    far = (recorded.abs() > _MAX_VALUE).to_numpy().any()
    if far or len(recorded.columns) < len(trajectory.columns) or (trajectory["visited"] < 0).any():
        raise InputError(
            f"{source}: a cell is not a number between {-_MAX_VALUE:g} and {_MAX_VALUE:g}, or a "
            f"count of visited waypoints is negative; restore the file"
        )
    if not trajectory["mode"].between(0, modes).all():
        raise InputError(
            f"{source}: mode must be from 0 to {modes}, the number of modes in setting.json, not "
            f"{trajectory['mode'].max():g}; restore both files"
        )


def list_rows(
    record: Record, generation: int | None, design: int | None, trial: int | None
) -> Iterator["pd.Series[str]"]:
    """Yield a design's rows in ``missions.csv``, by default the champion's."""
    missions = record.run.missions
    if design is None:
        world = next(iter(record.context.courses))
        design = int(tracks.find_champion_mission(record.run, world)["design"])
    chosen = missions[missions["design"] == design]
    for column, wanted in (("generation", generation), ("trial", trial)):
        if wanted is not None:
            chosen = chosen[chosen[column] == wanted]
    if chosen.empty:
        raise InputError(
            f"{record.path / 'missions.csv'}: no mission of design {design} with the given "
            f"generation and trial; change --design, --generation or --trial"
        )
    for _, row in chosen.iterrows():
        yield row


def add_missions(parser: argparse.ArgumentParser) -> None:
    """Add the options that select missions."""
    add_run(parser)
    add_worlds(parser)
    every = "instead of the champion's missions, the recorded missions"
    parser.add_argument("--design", type=int, metavar="ID", help=f"{every} of this individual")
    parser.add_argument("--generation", type=int, metavar="N", help=f"{every} of this generation")
    parser.add_argument("--trial", type=int, metavar="N", help=f"{every} of this trial")


def choose_missions(
    study: Study, options: argparse.Namespace
) -> tuple[Record, list[RecordedMission]]:
    """Return the selected run and its selected missions, at least one."""
    study.check_worlds(options.world or [])
    return study.choose(options.run, partial(_read, options=options))


def _read(record: Record, options: argparse.Namespace) -> list[RecordedMission]:
    record.run.require_trajectories()
    missions: list[RecordedMission] = []
    for read in _list_readers(record, options):
        try:
            missions.append(read())
        except InputError as error:
            LOGGER.warning("%s; left out", error)
    if not missions:
        raise InputError(
            f"{record.path}: no complete mission matches the options; choose other missions, or "
            "restore the run"
        )
    return missions


def _list_readers(
    record: Record, options: argparse.Namespace
) -> Iterator[Callable[[], RecordedMission]]:
    wanted = options.world or list(record.context.courses)
    numbers = (options.generation, options.design, options.trial)
    if numbers == (None, None, None):
        for world in record.context.courses:
            if world in wanted:
                yield partial(read_champion_mission, record, world)
        return
    record.run.require_trajectories(of_others=True)
    keeps_all = record.run.manifest.get("record") == "all"
    for row in list_rows(record, *numbers):
        if row["world"] in wanted and (keeps_all or is_kept(record, row)):
            yield partial(read_mission, record, row)
