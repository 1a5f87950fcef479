"""Renders a mission as a video of the robot, the obstacles and the sensor readings."""

import argparse
import math
import re
import sys
from collections.abc import Iterator
from functools import partial

from evoros.analysis.subcommands import Product, add_run
from evoros.analysis.tables.study import Study
from evoros.base.errors import InputError
from evoros.plugins.recordings.video.camera import CAMERAS, Pixels, RenderOptions, sample_times
from evoros.plugins.recordings.video.film import encode_mp4, film
from evoros.plugins.recordings.video.mission import read_mission

ONE_ROBOT = IN_VIEW = True  # show one robot with its sensors, and the other robots
WORST_MISSION = True
HELP = "a video of one of the champion's missions, with its sensor readings"
NEEDS = "a finished run, or an evaluation, that recorded trajectories"
FILES = {"video.mp4": "the video"}
FORMATS: dict[str, str] = {}
_OPTION_NAMES = {"start_s": "--from", "end_s": "--to"}
"""Options whose names differ from the fields of ``RenderOptions``."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for the mission and the view."""
    add_run(parser)
    parser.add_argument("--world", metavar="NAME", help="this world instead of the first one")
    about = "view from behind the robot (chase), or of the whole course (above); default: chase"
    parser.add_argument("--camera", choices=CAMERAS, default="chase", help=about)
    about = "speed relative to real time; default: 10"
    parser.add_argument("--speed", type=float, default=10.0, metavar="N", help=about)
    about = "frames per second of video; default: 25"
    parser.add_argument("--fps", type=float, default=25.0, metavar="N", help=about)
    about = "size in pixels, even numbers; default: 854x480"
    parser.add_argument("--size", default="854x480", metavar="WIDTHxHEIGHT", help=about)
    about = "mission time at which the video starts; default: 0"
    parser.add_argument("--from", dest="start", type=float, metavar="SECONDS", help=about)
    about = "mission time at which the video ends; default: the mission's end"
    parser.add_argument("--to", dest="end", type=float, metavar="SECONDS", help=about)
    parser.set_defaults(start=0.0, end=math.inf)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Make the video of the champion of the named run, by default the best run."""
    study.check_worlds([options.world] if options.world else [])
    read = partial(read_mission, world=options.world)
    record, (name, mission) = study.choose(options.run, read)
    chosen = _parse_options(options, name)
    count = len(sample_times(mission.trajectory, chosen))
    video = encode_mp4(_show_progress(film(mission, chosen), count), chosen.fps)
    message = f"{record.name}: the champion in {name}, at {chosen.speed:g} times real time"
    return Product(messages=[message], files={"video.mp4": video})


def _parse_options(options: argparse.Namespace, title: str) -> RenderOptions:
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", options.size)
    if match is None:
        raise InputError(f"--size: must be WIDTHxHEIGHT, not {options.size!r}; use --size 854x480")
    size, span = (int(match[1]), int(match[2])), (options.start, options.end)
    try:
        return RenderOptions(options.camera, size, options.fps, options.speed, *span, title)
    except InputError as error:
        text = re.sub(r"^RenderOptions\.(start_s|end_s)", lambda m: _OPTION_NAMES[m[1]], str(error))
        raise InputError(text.replace("RenderOptions.", "--")) from None


def _show_progress(pictures: Iterator[Pixels], count: int) -> Iterator[Pixels]:
    for index, picture in enumerate(pictures, 1):
        yield picture
        if sys.stderr.isatty():
            print(f"\r{index} of {count} pictures", end="", file=sys.stderr)
    if sys.stderr.isatty():
        print(file=sys.stderr)
