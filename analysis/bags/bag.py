"""Missions as rosbags, for rviz, Foxglove and ROS's own tools."""

import argparse
from collections.abc import Callable, Iterator
from functools import partial

from evoros.base.errors import InputError
from evoros.terminal.log import LOGGER

from ..product import Product
from ..subcommands import add_run, add_worlds
from ..tables.records import Record
from ..tables.shown import is_kept
from ..tables.study import Study
from .layout import make_layout
from .missions import RecordedMission, list_rows, read_champion_mission, read_mission
from .team import list_team_messages, list_team_topics

HELP = "recorded missions as rosbags, with a layout for Foxglove"
NEEDS = "a run that keeps trajectories, and the package rosbags"
FILES = {
    "bag_WORLD/": "a bag of rosbag2; with `--format ros1`, a file `bag_WORLD.bag`",
    "bag_GENERATION_DESIGN_WORLD_TRIAL/": "its name if a design, generation or trial is chosen",
    "bag.foxglove.json": "a layout for Foxglove",
}
FORMATS = {"mcap": "rosbag2, for Foxglove too", "ros1": "for rosbag play"}
OUTPUT = "bags"
DISTRO = "jazzy"
LAYOUT = "bag.foxglove.json"
GOALS = {"mcap": "/goal_pose", "ros1": "/move_base_simple/goal"}
"""The topic of the next waypoint, which rviz and the navigation of each ROS use."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the missions and of the messages' definitions."""
    add_run(parser)
    add_worlds(parser)
    every = "instead of the champion: the recorded missions"
    parser.add_argument("--design", type=int, metavar="ID", help=f"{every} of this individual")
    parser.add_argument("--generation", type=int, metavar="N", help=f"{every} of this generation")
    parser.add_argument("--trial", type=int, metavar="N", help=f"{every} of this trial")
    about = f"the ROS 2 whose messages are written; jazzy suits iron and later, too; {DISTRO}"
    parser.add_argument("--distro", choices=("humble", "jazzy"), help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Make a bag of each mission, and a layout beside them."""
    if options.format == "ros1" and options.distro:
        raise InputError("--distro: is for mcap, not for ros1; leave it out")
    study.check_worlds(options.world or [])
    record, missions = study.choose(options.run, partial(_read, options=options))
    topics = list_team_topics(missions[0], GOALS[options.format])
    layout = make_layout(topics, missions[0].root, list(missions[0].others))
    files = {LAYOUT: layout.encode()}
    for mission in missions:
        files |= _write(mission, options.format, options.distro or DISTRO)
    return Product(messages=[f"{record.name}: {len(missions)} missions"], files=files)


def _write(mission: RecordedMission, kind: str, distro: str) -> dict[str, bytes]:
    from .writing import write_mcap, write_ros1

    name, goal = mission.name, GOALS[kind]
    topics, messages = list_team_topics(mission, goal), list_team_messages(mission, goal)
    if kind == "ros1":
        return write_ros1(name, topics, messages)
    return write_mcap(name, topics, messages, distro)


def _read(record: Record, options: argparse.Namespace) -> list[RecordedMission]:
    """Read the missions of one design; report and skip those that cannot be read."""
    record.run.require_trajectories()
    missions: list[RecordedMission] = []
    for read in _list_readers(record, options):
        try:
            missions.append(read())
        except InputError as error:
            LOGGER.warning("%s; left out", error)
    if not missions:
        raise InputError(
            f"{record.path}: must have a complete mission as chosen, but has none; choose others, "
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
