"""A mission as a video: the robot among its obstacles, with the readings of its sensors."""

import argparse
import math
import re
import sys
from collections.abc import Iterator
from functools import partial

from evoros.base.errors import InputError

from ..product import Product
from ..subcommands import add_run
from ..tables.study import Study
from .camera import Pixels
from .encoding import encode_gif, encode_mp4
from .film import film
from .mission import read_mission
from .render_options import CAMERAS, RenderOptions, sample_times

ONE_ROBOT = IN_VIEW = True  # one with its sensors, and the others
HELP = "a mission of the champion as a video, with the readings of its sensors"
NEEDS = "a finished run that keeps trajectories"
FILES = {
    "video.FORMAT": "the video",
}
FORMATS = {"mp4": "", "gif": "keeps all pictures in memory, for a few seconds of video"}
_OPTION_NAMES = {"start_s": "--from", "end_s": "--to"}
"""Options whose name differs from their field of ``RenderOptions``."""
_DEFAULTS = {"mp4": ((854, 480), 25.0), "gif": ((480, 270), 10.0)}  # size, pictures per second


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the mission and how it is shown."""
    add_run(parser)
    parser.add_argument("--world", metavar="NAME", help="this world instead of the first")
    about = "behind the robot (chase), or the whole course (above); chase"
    parser.add_argument("--camera", choices=CAMERAS, default="chase", help=about)
    parser.add_argument(
        "--speed", type=float, default=10.0, metavar="N", help="times real time; 10"
    )
    about = "pictures per second of video, of a GIF a divisor of 100; 25, of a GIF 10"
    parser.add_argument("--fps", type=float, metavar="N", help=about)
    about = "in pixels, even numbers; 854x480, of a GIF 480x270"
    parser.add_argument("--size", metavar="WIDTHxHEIGHT", help=about)
    about = "time of the mission at which the video begins; 0"
    parser.add_argument("--from", dest="start", type=float, metavar="SECONDS", help=about)
    about = "time of the mission at which it ends; the mission's end"
    parser.add_argument("--to", dest="end", type=float, metavar="SECONDS", help=about)
    parser.set_defaults(start=0.0, end=math.inf)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Make the video of the named run's champion, or of the best run's."""
    study.check_worlds([options.world] if options.world else [])
    read = partial(read_mission, world=options.world)
    record, (name, mission) = study.choose(options.run, read)
    chosen = _parse_options(options, name)
    count = len(sample_times(mission.trajectory, chosen))
    encode = encode_gif if options.format == "gif" else encode_mp4
    video = encode(_show_progress(film(mission, chosen), count), chosen.fps)
    message = f"{record.name}: the champion in {name}, at {chosen.speed:g} times real time"
    return Product(messages=[message], files={f"video.{options.format}": video})


def _parse_options(options: argparse.Namespace, title: str) -> RenderOptions:
    size, fps = _DEFAULTS[options.format]
    if options.size is not None:
        match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", options.size)
        if match is None:
            raise InputError(
                f"--size: must be WIDTHxHEIGHT, not {options.size!r}; set it to 854x480, for "
                f"example"
            )
        size = int(match[1]), int(match[2])
    fps = fps if options.fps is None else options.fps
    if options.format == "gif" and not _is_whole(100 / fps if fps > 0 else 0.0):
        raise InputError(
            f"--fps: of a GIF must divide 100, because its clock ticks in hundredths of a second, "
            f"not {fps:g}; set it to 10, 20 or 25, for example"
        )
    values = (options.camera, size, fps, options.speed, options.start, options.end, title)
    try:
        return RenderOptions(*values)
    except InputError as error:
        text = re.sub(r"^RenderOptions\.(start_s|end_s)", lambda m: _OPTION_NAMES[m[1]], str(error))
        raise InputError(text.replace("RenderOptions.", "--")) from None


def _is_whole(value: float) -> bool:
    return value >= 1 and abs(value - round(value)) < 1e-9


def _show_progress(pictures: Iterator[Pixels], count: int) -> Iterator[Pixels]:
    """Yield the pictures, with their number on a terminal, because they take minutes."""
    for index, picture in enumerate(pictures, 1):
        yield picture
        if sys.stderr.isatty():
            print(f"\r{index} of {count} pictures", end="", file=sys.stderr)
    if sys.stderr.isatty():
        print(file=sys.stderr)
