"""Missions as rosbags, for rviz, Foxglove and ROS's own tools."""

import argparse

from evoros.base.errors import InputError

from ..product import Product
from ..tables.study import Study
from .choice import add_missions, choose_missions
from .layout import make_layout
from .missions import RecordedMission
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
    add_missions(parser)
    about = f"the ROS 2 whose messages are written; jazzy suits iron and later, too; {DISTRO}"
    parser.add_argument("--distro", choices=("humble", "jazzy"), help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Make a bag of each mission, and a layout beside them."""
    if options.format == "ros1" and options.distro:
        raise InputError("--distro: is for mcap, not for ros1; leave it out")
    record, missions = choose_missions(study, options)
    topics = list_team_topics(missions[0], GOALS[options.format])
    layout = make_layout(topics, missions[0].root, list(missions[0].others))
    files = {LAYOUT: layout.encode()}
    for mission in missions:
        files |= _write(mission, options.format, options.distro or DISTRO)
    return Product(messages=[f"{record.name}: {len(missions)} missions"], files=files)


def _write(mission: RecordedMission, kind: str, distro: str) -> dict[str, bytes]:
    from .writing import write_mcap, write_ros1

    name, goal = f"bag_{mission.name}", GOALS[kind]
    topics, messages = list_team_topics(mission, goal), list_team_messages(mission, goal)
    if kind == "ros1":
        return write_ros1(name, topics, messages)
    return write_mcap(name, topics, messages, distro)
