"""A mission as a video: the robot among its obstacles, with what its sensors see."""

import argparse
import math
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd
from PIL import Image

from evoros.base.errors import InputError
from evoros.formats.strict_xml import parse
from evoros.formats.urdf.tree import read_tree
from evoros.simulator.engines.pybullet_viewer import open_scene
from evoros.storage.figure_context import FigureContext
from evoros.world.model import World

from ..product import Product
from ..tables.records import Record
from ..tables.study import Study
from ..tables.tracks import champions_world, track
from .camera import Pixels
from .captions import write
from .encoding import gif, mp4
from .film import CAMERAS, Film, cameras, captions, times
from .motion import check_poses, motion
from .renderer import Footage, eyes, failures, goals, obstacles, painted

HELP = "a mission of the champion as a video, with what its sensors see"
FORMATS = ("mp4", "gif")
_TYPED = {"start_s": "from", "end_s": "to"}
"""What the fields of a film are called on the command line, where that differs."""
_USUAL = {"mp4": ((854, 480), 25.0), "gif": ((480, 270), 10.0)}  # size, pictures per second


def arguments(parser: argparse.ArgumentParser) -> None:
    """Which mission, and how it is shown."""
    parser.add_argument("--run", metavar="NAME", help="instead of the best run")
    parser.add_argument("--world", metavar="NAME", help="instead of the first")
    parser.add_argument("--camera", choices=CAMERAS, default="chase", help="chase")
    parser.add_argument("--speed", type=float, default=10.0, help="times real time; 10")
    parser.add_argument("--fps", type=float, help="pictures per second; 25, of a GIF 10")
    parser.add_argument("--size", metavar="WIDTHxHEIGHT", help="854x480, of a GIF 480x270")
    parser.add_argument("--from", dest="start", type=float, default=0.0, metavar="SECONDS")
    parser.add_argument("--to", dest="end", type=float, default=math.inf, metavar="SECONDS")


def product(study: Study, options: argparse.Namespace) -> Product:
    """Of the run that was asked for, else of the best."""
    study.check_worlds([options.world] if options.world else [])
    record, take = study.chosen(options.run, partial(_take, world=options.world))
    film = _film(options, take.name)
    pictures = _pictures(take, film)
    video = (gif if options.format == "gif" else mp4)(pictures, film.fps)
    said = f"{record.name}: the champion in {take.name}, {film.speed:g} times as fast as it was"
    return Product(said=[said], files={f"replay.{options.format}": video})


def _film(options: argparse.Namespace, title: str) -> Film:
    size, fps = _USUAL[options.format]
    if options.size is not None:
        match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", options.size)
        if match is None:
            raise InputError(
                f"--size: must be WIDTHxHEIGHT, not {options.size!r}; for example 854x480"
            )
        size = int(match[1]), int(match[2])
    fps = fps if options.fps is None else options.fps
    if options.format == "gif" and not _whole(100 / fps if fps > 0 else 0.0):
        raise InputError(
            f"--fps: of a GIF must divide 100, for its clock ticks in hundredths of a second, "
            f"not {fps:g}; for example 10, 20 or 25"
        )
    try:
        return Film(options.camera, size, fps, options.speed, options.start, options.end, title)
    except InputError as error:
        said = re.sub(r"^Film\.(\w+)", lambda name: f"--{_TYPED.get(name[1], name[1])}", str(error))
        raise InputError(said) from None


def _whole(number: float) -> bool:
    return number >= 1 and abs(number - round(number)) < 1e-9


@dataclass(frozen=True, eq=False)
class _Take:
    """What a film of a champion's mission is made of."""

    name: str  # of the world
    trajectory: pd.DataFrame
    urdf: str
    world: World
    setting: FigureContext
    failed: Mapping[int, float]
    near_m: float | None


def _take(record: Record, world: str | None) -> _Take:
    """Of the named world, or the first."""
    name = world or next(iter(record.setting.courses))
    if name not in record.setting.courses:
        raise InputError(f"{record.path}: must have the world {name!r}, and has not")
    path = record.path / "champion" / "robot.urdf"
    trajectory = record.run.trajectory(name)
    check_poses(trajectory, str(path.with_name(f"trajectory_{name}.csv")))
    try:
        urdf = path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error}); restore the file") from error
    return _Take(
        name,
        trajectory,
        urdf,
        champions_world(record.run, record.setting, name),
        record.setting,
        _failed(track(record.run, record.setting, name)),
        _number(record.values.get("controller.avoidance.range_m")),
    )


def _pictures(take: _Take, film: Film) -> Iterator[Pixels]:
    """With a line on the terminal that says how far it is: it takes minutes."""
    count = len(times(take.trajectory, film))
    pictures = replay(
        take.trajectory, take.urdf, take.world, take.setting, film, take.failed, take.near_m
    )
    for number, picture in enumerate(pictures, 1):
        yield picture
        if sys.stderr.isatty():
            print(f"\r{number} of {count} pictures", end="", file=sys.stderr)
    if sys.stderr.isatty():
        print(file=sys.stderr)


def _failed(story: pd.DataFrame) -> dict[int, float]:
    """When [s] each sensor failed, of those that did, in a table as ``tracks.track`` makes it."""
    return {
        int(number): float(time)
        for time, numbers in zip(story["time_s"], story["failed_sensors"], strict=True)
        for number in str(numbers).split(";")
        if number
    }


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) else None


def replay(
    trajectory: pd.DataFrame,
    urdf: str,
    world: World,
    setting: FigureContext,
    film: Film | None = None,
    failed: Mapping[int, float] | None = None,
    near_m: float | None = None,
) -> Iterator[Pixels]:
    """The pictures (h, w, 3) uint8 of a mission, one after another.

    ``trajectory`` is a table as ``champion/trajectory_WORLD.csv`` or ``evoros.replay`` has it,
    ``urdf`` the robot that flew it, with its sensors. ``failed`` has the times [s] at which sensors
    failed. Readings below ``near_m`` are marked; None: below half the sensor's range.

    Raises:
        InputError: PyBullet is not installed, or the trajectory does not fit.
    """
    check_poses(trajectory)
    film = film or Film()
    robot = read_tree(parse(urdf.encode(), "robot.urdf"), "robot.urdf")
    columns = [name for name in trajectory if re.fullmatch(r"range_\d+_m", str(name))]
    sensors = eyes(robot, setting, len(columns), near_m)
    moves = motion(trajectory, times(trajectory, film), robot)
    now = trajectory.iloc[moves.record]
    places = trajectory[["x_m", "y_m"]].to_numpy(float)
    next_goals = goals(world, places, trajectory["visited"].to_numpy(int))
    said = captions(trajectory, moves, world, setting, film)
    views = list(cameras(moves, world, places, film))
    with open_scene(urdf, obstacles(world)) as scene:
        footage = Footage(
            scene,
            moves,
            sensors,
            now[columns].to_numpy(float),
            failures(moves.time_s, len(columns), failed or {}),
            next_goals[moves.record],
            setting,
            painted(world, places),
        )
        for number, (camera, caption) in enumerate(zip(views, said, strict=True)):
            picture = Image.fromarray(footage.picture(number, camera))
            write(picture, caption._replace(states=footage.states(number)))
            yield np.asarray(picture)
