"""Missions as rosbags, for rviz, Foxglove and ROS's own tools."""

import argparse
from collections.abc import Sequence
from functools import partial

from evoros.base.errors import InputError
from evoros.base.log import LOGGER

from ..product import Product
from ..tables.records import Record
from ..tables.study import Study
from .layout import make_layout
from .messages import list_messages, list_topics
from .missions import RecordedMission, read_champion_missions

HELP = "recorded missions as rosbags, with a layout for Foxglove"
FORMATS = ("mcap", "ros1")
OUTPUT = "bags"
DISTRO = "jazzy"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the missions and of the messages' definitions."""
    parser.add_argument("--run", metavar="NAME", help="instead of the best run")
    parser.add_argument(
        "--world", metavar="NAME", action="append", help="only this world; may be repeated"
    )
    parser.add_argument(
        "--distro",
        choices=("humble", "jazzy"),
        help=f"of ROS 2, whose messages are written; jazzy suits iron and later; {DISTRO}",
    )


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Make a bag of each mission, and a layout beside it."""
    if options.format == "ros1" and options.distro:
        raise InputError("--distro: is for mcap, not for ros1; leave it out")
    study.check_worlds(options.world or [])
    record, missions = study.choose(options.run, partial(_read, wanted=options.world))
    files: dict[str, bytes] = {}
    for mission in missions:
        files |= _write(mission, options.format, options.distro or DISTRO)
    return Product(messages=[f"{record.name}: {len(missions)} missions"], files=files)


def _write(mission: RecordedMission, kind: str, distro: str) -> dict[str, bytes]:
    from .writing import write_mcap, write_ros1

    name, topics, messages = mission.name, list_topics(mission), list_messages(mission)
    layout = {f"{name}.foxglove.json": make_layout(topics, mission.tree.root).encode()}
    if kind == "ros1":
        return {**write_ros1(name, topics, messages), **layout}
    return {**write_mcap(name, topics, messages, distro), **layout}


def _read(record: Record, wanted: Sequence[str] | None) -> list[RecordedMission]:
    """Read the champion's missions; report and skip those that cannot be read."""
    missions: list[RecordedMission] = []
    for world in record.context.courses:
        if wanted and world not in wanted:
            continue
        try:
            missions += read_champion_missions(record, [world])
        except InputError as error:
            LOGGER.warning("%s; %s is left out", error, world)
    if not missions:
        raise InputError(
            f"{record.path}: must have a complete mission of its champion, but has none; restore it"
        )
    return missions
