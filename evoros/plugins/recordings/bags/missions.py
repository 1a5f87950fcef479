"""Recorded missions with all robots, and the options that choose missions for export."""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from evoros.analysis.subcommands import add_run, add_worlds
from evoros.analysis.tables import tracks
from evoros.analysis.tables.agents import select_agent
from evoros.analysis.tables.champions import adapt_context
from evoros.analysis.tables.designs import adapt_types, read_evolved
from evoros.analysis.tables.readings import RecordedSensor, read_sensors
from evoros.analysis.tables.records import Record
from evoros.analysis.tables.shown import is_kept
from evoros.analysis.tables.study import Study
from evoros.analysis.tables.walkers import WalkerTrack, list_walkers
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
from evoros.terminal.log import LOGGER
from evoros.world.model import World

_LARGEST = 1e9  # upper limit of numbers in a mission, which must fit into messages


@dataclass(frozen=True, eq=False)
class RecordedMission:
    """A recorded mission from the point of view of one robot."""

    name: str  # WORLD, or GENERATION_DESIGN_WORLD_TRIAL
    row: "pd.Series[str]"  # the mission's row of ``missions.csv``
    context: FigureContext  # includes the evolved parameters of the sensor types
    trajectory: pd.DataFrame  # has the columns of ``trajectory_WORLD.csv``
    urdf: str  # description of the robot with its sensors
    loaded_urdf: str  # description that engines load
    joints: Sequence[Joint]
    root: str  # root link
    root_pose: Pose  # pose of the root link in the frame that the trajectory records
    sensors: Sequence[RecordedSensor]
    world: World
    route: Array  # (legs, 2) waypoints [m] in the order of the route
    others: Mapping[str, "RecordedMission"] = field(default_factory=dict)
    """The mission from the point of view of each other robot, by name."""
    walkers: Sequence[WalkerTrack] = ()


def read_champion_mission(record: Record, world: str) -> RecordedMission:
    """Read the champion's first mission in a world."""
    row, context = tracks.find_champion_mission(record.run, world), adapt_context(record)
    files = _Files(
        world,
        record.run.champion_file(f"trajectory_{world}.csv"),
        record.run.champion_file("robot.urdf", record.agent),
        record.run.champion_file(ROBOT_AS_LOADED, record.agent),
    )
    scene = tracks.load_champion_world(record.run, record.context, world), context
    mission = _assemble(record, row, files, record.run.trajectory(world), scene)
    return replace(mission, others=_read_others(record, read_champion_mission, world))


def _read_others(
    record: Record, read: Callable[[Record, Any], RecordedMission], mission: Any
) -> dict[str, RecordedMission]:
    return {name: read(select_agent(record, name), mission) for name in record.context.agents}


def read_mission(record: Record, row: "pd.Series[str]") -> RecordedMission:
    """Read the mission in a row of ``missions.csv`` from a run that stores all trajectories."""
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
    scene = tracks.load_mission_world(record.run, record.context, row), context
    mission = _assemble(record, row, files, record.run.mission_trajectory(*key), scene)
    return replace(mission, others=_read_others(record, read_mission, row))


class _Files(NamedTuple):
    mission: str
    trajectory: Path
    described: Path  # description of the robot with its sensors
    loaded: Path  # description that engines load, if it differs from ``described``


def _assemble(
    record: Record,
    row: "pd.Series[str]",
    files: _Files,
    trajectory: pd.DataFrame,
    scene: tuple[World, FigureContext],
) -> RecordedMission:
    (world, context), agent = scene, record.agent
    _check(trajectory, files.trajectory, context)
    urdf, source = read_text(files.described), str(files.described)
    loaded = read_text(files.loaded) if files.loaded.is_file() else urdf
    elements = parse(urdf.encode(), source)
    # ``read_tree`` rejects meshes, which only the loaded robot replaces with shapes.
    links = [str(link.get("name")) for link in elements.findall("link")]
    joints = [read_joint(joint, links) for joint in elements.findall("joint")]
    root = next(iter({*links} - {joint.child for joint in joints}))
    root_pose = Pose()  # engines may add a link above the root
    if loaded != urdf:
        tree = read_tree(parse(loaded.encode(), files.loaded.name), str(files.loaded))
        root_pose = tree.poses.get(root, root_pose)
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
        root_pose=root_pose,
        sensors=read_sensors(trajectory, links, context, source),
        world=world,
        route=world.course.route(world.course.goes_forward(round_index, rng)),
        walkers=list_walkers(trajectory, record.values),
    )


def _check(trajectory: pd.DataFrame, source: Path, context: FigureContext) -> None:
    if trajectory.empty:
        raise InputError(
            f"{source}: no rows, because the mission could not be run; choose another mission"
        )
    numbers = ("time_s", "x_m", "y_m", "yaw_rad", "speed_mps", "steering_rad", "mode", "visited")
    if trajectory[[*numbers]].isna().to_numpy().any() or (trajectory["time_s"].diff() < 0).any():
        raise InputError(
            f"{source}: a cell other than a reading is empty, or times decrease; restore the file"
        )
    recorded = trajectory.select_dtypes("number")
    far = (recorded.abs() > _LARGEST).to_numpy().any()
    if far or len(recorded.columns) < len(trajectory.columns) or (trajectory["visited"] < 0).any():
        raise InputError(
            f"{source}: a cell is not a number of at most {_LARGEST:g}, or a number of visited "
            f"waypoints is negative; restore the file"
        )
    if not trajectory["mode"].between(0, len(context.modes)).all():
        raise InputError(
            f"{source}: mode must be from 0 to {len(context.modes)}, the number of modes in "
            f"setting.json, not {trajectory['mode'].max():g}; restore both files"
        )


def list_rows(
    record: Record, generation: int | None, design: int | None, trial: int | None
) -> Iterator["pd.Series[str]"]:
    """Yield a design's rows of ``missions.csv`` in order, by default the champion's."""
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
    """Add the options that choose missions."""
    add_run(parser)
    add_worlds(parser)
    every = "instead of the champion's missions, the recorded missions"
    parser.add_argument("--design", type=int, metavar="ID", help=f"{every} of this individual")
    parser.add_argument("--generation", type=int, metavar="N", help=f"{every} of this generation")
    parser.add_argument("--trial", type=int, metavar="N", help=f"{every} of this trial")


def choose_missions(
    study: Study, options: argparse.Namespace
) -> tuple[Record, list[RecordedMission]]:
    """Return the chosen run and at least one chosen mission."""
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
            f"{record.path}: no complete mission fits the options; choose other missions, "
            f"or restore the run"
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
