"""A mission as a video: the robot among its obstacles, with what its sensors see."""

import argparse
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from PIL import Image

from evoros.errors import NOT_NEGATIVE, POSITIVE, InputError, Rule, check, is_whole, one_of
from evoros.setting import Setting
from evoros.simulator.pybullet_scene import open_scene
from evoros.types import Array
from evoros.urdf.tree import read_tree
from evoros.world import World
from evoros.xmlfile import parse

from .camera import Camera, Pixels, above, chase
from .captions import CLEAR, FAILED, NEAR, Caption, write
from .footage import Footage, eyes, failures, goals, obstacles, painted
from .motion import Motion, check_poses, motion
from .product import Product
from .study import Record, Study
from .tracks import champions_worlds, track
from .video import gif, mp4

HELP = "a mission of the champion as a video, with what its sensors see"
FORMATS = ("mp4", "gif")
CAMERAS = ("chase", "above")
SIZE = Rule(
    "two even whole numbers of pixels, from 64 to 4096",
    lambda v: len(v) == 2 and all(is_whole(e) and 64 <= e <= 4096 and e % 2 == 0 for e in v),
)
_USUAL = {"mp4": ((854, 480), 25.0), "gif": ((480, 270), 10.0)}  # size, pictures per second
_CALM_S = 0.7  # of video: how slowly the camera that follows turns
_MARGIN_M = 1.5  # around what the camera above sees, for the strips with text


@dataclass(frozen=True)
class Film:
    """How a mission is shown."""

    camera: str = "chase"  # behind the robot; above: the whole course
    size: tuple[int, int] = (854, 480)  # width, height
    fps: float = 25.0  # pictures per second of video
    speed: float = 8.0  # times as fast as it was
    start_s: float = 0.0
    end_s: float = math.inf  # of the mission; its end, where it ends before
    title: str = ""

    def __post_init__(self) -> None:
        check(
            self,
            camera=one_of(*CAMERAS),
            size=SIZE,
            fps=POSITIVE,
            speed=POSITIVE,
            start_s=NOT_NEGATIVE,
            end_s=Rule("greater than start_s", lambda v: v > self.start_s),
        )


def arguments(parser: argparse.ArgumentParser) -> None:
    """Which mission, and how it is shown."""
    parser.add_argument("--run", metavar="NAME", help="instead of the best run")
    parser.add_argument("--world", metavar="NAME", help="instead of the first")
    parser.add_argument("--camera", choices=CAMERAS, default="chase", help="chase")
    parser.add_argument("--speed", type=float, default=8.0, help="times real time; 8")
    parser.add_argument("--fps", type=float, help="pictures per second; 25, of a GIF 10")
    parser.add_argument("--size", metavar="WIDTHxHEIGHT", help="854x480, of a GIF 480x270")
    parser.add_argument("--from", dest="start", type=float, default=0.0, metavar="SECONDS")
    parser.add_argument("--to", dest="end", type=float, default=math.inf, metavar="SECONDS")


def product(study: Study, options: argparse.Namespace) -> Product:
    """Of the run that was asked for, else of the best."""
    record = study.only(options.run) if options.run else study.best
    if not record.finished:
        raise InputError(
            f"{record.path}: must be finished, to have a champion to show, and is not; "
            f"type: evoros resume={record.path}"
        )
    name = options.world or next(iter(record.setting.courses))
    if name not in record.setting.courses:
        known = ", ".join(record.setting.courses)
        raise InputError(f"--world: must be one of {known}, not {name!r}; correct the name")
    film = _film(options, name)
    pictures = _champions(record, name, film)
    video = (gif if options.format == "gif" else mp4)(pictures, film.fps)
    said = f"{record.name}: the champion in {name}, {film.speed:g} times as fast as it was"
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
    return Film(options.camera, size, fps, options.speed, options.start, options.end, title)


def _whole(number: float) -> bool:
    return number >= 1 and abs(number - round(number)) < 1e-9


def _champions(record: Record, world: str, film: Film) -> Iterator[Pixels]:
    """The champion's mission in a world."""
    path = record.path / "champion" / "robot.urdf"
    try:
        urdf = path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error}); restore the file") from error
    story = track(record.run, record.setting, world)
    failed: dict[int, float] = {}
    for time, numbers in story.loc[
        story["failed_sensors"] != "", ["time_s", "failed_sensors"]
    ].values:
        failed |= {int(number): float(time) for number in str(numbers).split(";")}
    near = record.values.get("controller.avoidance.range_m")
    return replay(
        record.run.trajectory(world),
        urdf,
        champions_worlds(record.run, record.setting)[world],
        record.setting,
        film,
        failed,
        float(near) if isinstance(near, int | float) else None,
    )


def replay(
    trajectory: pd.DataFrame,
    urdf: str,
    world: World,
    setting: Setting,
    film: Film = Film(),
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
    robot = read_tree(parse(urdf.encode(), "robot.urdf"), "robot.urdf")
    columns = [name for name in trajectory if re.fullmatch(r"range_\d+_m", str(name))]
    sensors = eyes(robot, setting, len(columns), near_m)
    moves = motion(trajectory, _times(trajectory, film), robot)
    now = trajectory.iloc[moves.record]
    places = trajectory[["x_m", "y_m"]].to_numpy(float)
    next_goals = goals(world, places, trajectory["visited"].to_numpy(int))
    captions = _captions(trajectory, moves, world, setting, film)
    cameras = list(_cameras(moves, world, places, film))
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
        for number, (camera, said) in enumerate(zip(cameras, captions, strict=True)):
            picture = Image.fromarray(footage.picture(number, camera))
            write(picture, said._replace(states=footage.states(number)))
            yield np.asarray(picture)


def _times(trajectory: pd.DataFrame, film: Film) -> Array:
    """(n,) [s]: of each picture; the last is that of the end."""
    first, last = (float(trajectory["time_s"].iloc[row]) for row in (0, -1))
    start, end = max(film.start_s, first), min(film.end_s, last)
    if start > end:
        raise InputError(
            f"from {film.start_s:g} s: must be before the mission ends at {last:g} s; begin earlier"
        )
    step = film.speed / film.fps
    count = math.ceil((end - start) / step - 1e-9) + 1
    times: Array = np.minimum(start + step * np.arange(count), end)
    return times


def _cameras(moves: Motion, world: World, places: Array, film: Film) -> Iterator[Camera]:
    if film.camera == "above":
        points = np.vstack([places, world.course.route(True)])
        margin = world.course.acceptance_m + _MARGIN_M
        camera = above(points.min(axis=0) - margin, points.max(axis=0) + margin, film.size)
        yield from [camera] * len(moves.time_s)
        return
    yaws = _calm(moves.yaw_rad, _CALM_S * film.fps)
    for x, y, yaw in zip(moves.x_m, moves.y_m, yaws, strict=True):
        yield chase(float(x), float(y), float(yaw), film.size)


def _calm(values: Array, sigma: float) -> Array:
    """Values (n,), each the mean of those around it, weighted by a normal distribution."""
    reach = math.ceil(3 * sigma)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    wider = np.pad(values, reach, mode="edge")
    calm: Array = np.convolve(wider, weights / weights.sum(), mode="valid")
    return calm


def _captions(
    trajectory: pd.DataFrame, moves: Motion, world: World, setting: Setting, film: Film
) -> Iterator[Caption]:
    key = ((CLEAR, "clear"), (NEAR, "near"), (FAILED, "failed or silent"))
    end, goals_there = float(trajectory["time_s"].iloc[-1]), len(world.course.route(True))
    contacts = trajectory.get("contact", pd.Series(0, trajectory.index)).to_numpy() > 0
    modes = ("none", *setting.modes)
    for time, row in zip(moves.time_s, moves.record, strict=True):
        visited, mode = int(trajectory["visited"].iloc[row]), int(trajectory["mode"].iloc[row])
        doing = "collision" if contacts[row] else modes[mode] if mode < len(modes) else str(mode)
        at = "completed" if visited == goals_there else f"waypoint {visited + 1} of {goals_there}"
        said = (film.title, f"{time:.0f} s of {end:.0f} s", at, doing)
        yield Caption(said, f"{film.speed:g} x real time", (), key)
