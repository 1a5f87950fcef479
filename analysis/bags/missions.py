"""Recorded missions, with all that their bags need."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.formats.strict_xml import parse
from evoros.formats.urdf.tree import Urdf, read_tree
from evoros.geometry.shapes import Pose
from evoros.storage.figure_context import Beam, FigureContext
from evoros.storage.mission_log import ROBOT_AS_LOADED
from evoros.world.model import World

from ..tables.records import Record
from ..tables.tracks import find_champion_mission, load_champion_world


@dataclass(frozen=True, eq=False)
class RecordedMission:
    """A mission as it was recorded."""

    name: str  # of its bag
    trajectory: pd.DataFrame  # with the columns of ``trajectory_WORLD.csv``
    urdf: str  # the robot with its sensors
    tree: Urdf  # of ``urdf``
    root: Pose  # of the root link of ``urdf`` in the frame that the trajectory is of
    sensors: Sequence[tuple[str, Beam]]  # link and type of each, in the order of the readings
    world: World
    route: Array  # (legs, 2) waypoints in order [m]
    modes: Sequence[str]  # by their number in the trajectory, from 1


def read_champion_missions(record: Record, worlds: Sequence[str]) -> Iterator[RecordedMission]:
    """Read the champion's mission in each of these worlds.

    Raises:
        InputError: a file is missing or damaged, or a mission could not be run.
    """
    folder = record.path / "champion"
    for name in worlds:
        world = load_champion_world(record.run, record.context, name)
        row = find_champion_mission(record.run, name)
        trajectory = record.run.trajectory(name)
        source = folder / f"trajectory_{name}.csv"
        yield assemble(f"bag_{name}", row, trajectory, source, folder, world, record.context)


def assemble(
    name: str,
    row: "pd.Series[str]",
    trajectory: pd.DataFrame,
    source: Path,
    robot_folder: Path,
    world: World,
    context: FigureContext,
) -> RecordedMission:
    """Put a mission together from its row of ``missions.csv`` and its files.

    Raises:
        InputError: the files do not fit each other.
    """
    _check(trajectory, source, context)
    urdf = _read_text(robot_folder / "robot.urdf")
    tree = read_tree(parse(urdf.encode(), "robot.urdf"), str(robot_folder / "robot.urdf"))
    columns = [column for column in trajectory if str(column).startswith("range_")]
    forward = world.course.goes_forward(
        int(row["generation"]), generator(str(row["draws"]), "course")
    )
    return RecordedMission(
        name=name,
        trajectory=trajectory,
        urdf=urdf,
        tree=tree,
        root=_find_root(tree, robot_folder / ROBOT_AS_LOADED),
        sensors=_find_sensors(tree, context, len(columns)),
        world=world,
        route=world.course.route(forward),
        modes=context.modes,
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
    if not trajectory["mode"].between(0, len(context.modes)).all():
        raise InputError(
            f"{source}: mode must be from 0 to {len(context.modes)}, the modes of setting.json, "
            f"not {trajectory['mode'].max():g}; restore the files"
        )


def _read_text(path: Path) -> str:
    try:
        return path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error}); restore the file") from error


def _find_root(tree: Urdf, loaded: Path) -> Pose:
    """Return the pose of the root link above the ground between the wheels.

    Trajectories are of the root of what engines load, which has a root of its own if that of the
    described robot is elsewhere.
    """
    if not loaded.is_file():
        return Pose()
    whole = read_tree(parse(_read_text(loaded).encode(), loaded.name), str(loaded))
    return whole.poses.get(tree.root, Pose())


def _find_sensors(tree: Urdf, context: FigureContext, count: int) -> list[tuple[str, Beam]]:
    links = [
        (f"{kind}_{number}", beam)
        for number in range(count)
        for kind, beam in context.beams.items()
        if f"{kind}_{number}" in tree.poses
    ]
    if len(links) != count:
        raise tree.error(
            f"must have a link for each of the {count} sensors of the trajectory, but has "
            f"{len(links)}",
            "restore the file",
        )
    return links
