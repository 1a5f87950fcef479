"""A mission as a video: the robot among its obstacles, with the readings of its sensors."""

import argparse
import math
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd
from PIL import Image

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.formats.strict_xml import parse
from evoros.formats.urdf.tree import read_tree
from evoros.simulator.engines.pybullet_viewer import open_scene
from evoros.storage.fault_effects import ENDS
from evoros.storage.figure_context import FigureContext
from evoros.storage.layout import ROBOT_AS_LOADED
from evoros.storage.verification import read_text
from evoros.world.model import World

from ..product import Product
from ..tables.agents import list_others
from ..tables.designs import adapt_context
from ..tables.readings import read_sensors
from ..tables.records import Record
from ..tables.study import Study
from ..tables.tracks import load_champion_world, read_track
from .camera import Pixels
from .captions import write_caption
from .encoding import encode_gif, encode_mp4
from .faults import ShownFault, flag_ends, measure_errors
from .motion import check_poses, interpolate
from .render_options import CAMERAS, RenderOptions, make_captions, place_cameras, sample_times
from .renderer import (
    Other,
    Renderer,
    cut_obstacles,
    find_goals,
    paint_ground,
)
from .sensors import make_views

ONE_ROBOT = IN_VIEW = True  # one with its sensors, and the others
HELP = "a mission of the champion as a video, with the readings of its sensors"
FORMATS = ("mp4", "gif")
_OPTION_NAMES = {"start_s": "from", "end_s": "to"}
"""Options whose name differs from that of their field of ``RenderOptions``."""
_DEFAULTS = {"mp4": ((854, 480), 25.0), "gif": ((480, 270), 10.0)}  # size, pictures per second


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the mission and how it is shown."""
    parser.add_argument("--run", metavar="NAME", help="instead of the best run")
    parser.add_argument("--world", metavar="NAME", help="instead of the first")
    parser.add_argument("--camera", choices=CAMERAS, default="chase", help="chase")
    parser.add_argument("--speed", type=float, default=10.0, help="times real time; 10")
    parser.add_argument("--fps", type=float, help="pictures per second; 25, of a GIF 10")
    parser.add_argument("--size", metavar="WIDTHxHEIGHT", help="854x480, of a GIF 480x270")
    parser.add_argument("--from", dest="start", type=float, default=0.0, metavar="SECONDS")
    parser.add_argument("--to", dest="end", type=float, default=math.inf, metavar="SECONDS")


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Make the video of the named run's champion, or of the best run's."""
    study.check_worlds([options.world] if options.world else [])
    record, mission = study.choose(options.run, partial(_read_mission, world=options.world))
    render_options = _parse_options(options, mission.world_name)
    encode = encode_gif if options.format == "gif" else encode_mp4
    video = encode(_show_progress(mission, render_options), render_options.fps)
    name, speed = mission.world_name, render_options.speed
    message = f"{record.name}: the champion in {name}, at {speed:g} times real time"
    return Product(messages=[message], files={f"replay.{options.format}": video})


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
        pattern = r"^RenderOptions\.(\w+)"
        raise InputError(re.sub(pattern, _name_option, str(error))) from None


def _name_option(field: re.Match[str]) -> str:
    return f"--{_OPTION_NAMES.get(field[1], field[1])}"


def _is_whole(number: float) -> bool:
    return number >= 1 and abs(number - round(number)) < 1e-9


class OtherRobot(NamedTuple):
    """Another robot of a mission, which is shown without its sensors."""

    trajectory: pd.DataFrame
    urdf: str
    context: FigureContext


@dataclass(frozen=True, eq=False)
class _Mission:
    """A champion's mission as it is shown."""

    world_name: str
    trajectory: pd.DataFrame
    urdf: str
    world: World
    context: FigureContext
    faults: Sequence[ShownFault]
    near_m: float | None
    others: Sequence[OtherRobot]


def _read_mission(record: Record, world: str | None) -> _Mission:
    """Read the champion's mission in the named world, or in the first."""
    context = record.context
    name = world or next(iter(context.courses))
    if name not in context.courses:
        raise InputError(f"{record.path}: must have the world {name!r}, but has not; give another")
    near_m = record.values.get("controller.avoidance.range_m")
    return _Mission(
        name,
        _read_trajectory(record, name),
        _read_urdf(record),
        load_champion_world(record.run, context, name),
        adapt_context(record),
        list(_list_faults(read_track(record.run, context, name), record.context.failure.effects)),
        float(near_m) if isinstance(near_m, int | float) else None,
        [
            OtherRobot(_read_trajectory(each, name), _read_urdf(each), each.context)
            for each in list_others(record)
        ],
    )


def _read_trajectory(record: Record, world: str) -> pd.DataFrame:
    trajectory = record.run.trajectory(world)
    check_poses(trajectory, f"{record.path / 'champion'}/trajectory_{world}.csv")
    return trajectory


def _read_urdf(record: Record) -> str:
    loaded, built = (record.robot_folder / name for name in (ROBOT_AS_LOADED, "robot.urdf"))
    path = loaded if loaded.exists() else built
    return read_text(path)


def _list_faults(track: pd.DataFrame, effects: Mapping[str, str]) -> Iterator[ShownFault]:
    """List the faults of a mission, by the records of its track; ``effects`` tell their kinds."""
    columns = ("time_s", "failed_sensors", "failed_by")
    for time, sensors, names in zip(*(track[name] for name in columns), strict=True):
        for sensor, name in zip(str(sensors).split(";"), str(names).split(";"), strict=True):
            if sensor:
                yield ShownFault(int(sensor), float(time), effects.get(name, ENDS))


def _show_progress(mission: _Mission, options: RenderOptions) -> Iterator[Pixels]:
    """Yield the pictures, with their number on a terminal, because they take minutes."""
    count = len(sample_times(mission.trajectory, options))
    pictures = replay(
        mission.trajectory,
        mission.urdf,
        mission.world,
        mission.context,
        options,
        mission.faults,
        mission.near_m,
        mission.others,
    )
    for number, picture in enumerate(pictures, 1):
        yield picture
        if sys.stderr.isatty():
            print(f"\r{number} of {count} pictures", end="", file=sys.stderr)
    if sys.stderr.isatty():
        print(file=sys.stderr)


def replay(
    trajectory: pd.DataFrame,
    urdf: str,
    world: World,
    context: FigureContext,
    options: RenderOptions | None = None,
    faults: Sequence[ShownFault] = (),
    near_m: float | None = None,
    others: Sequence[OtherRobot] = (),
) -> Iterator[Pixels]:
    """Yield the pictures (h, w, 3) of a mission.

    ``trajectory`` is a table as ``champion/trajectory_WORLD.csv`` or ``evoros.replay`` has it,
    ``urdf`` the robot that ran it, with its sensors. ``faults`` are those of its sensors.
    Readings below ``near_m`` are marked; None stands for half the sensor's range.
    ``others`` are the other robots of the mission.

    Raises:
        InputError: PyBullet is not installed, or the trajectory does not fit.
    """
    check_poses(trajectory)
    options = options or RenderOptions()
    robot = read_tree(parse(urdf.encode(), "robot.urdf"), "robot.urdf")
    recorded = read_sensors(trajectory, robot.poses, context, "robot.urdf")
    times = sample_times(trajectory, options)
    motion = interpolate(trajectory, times, robot)
    places = trajectory[["x_m", "y_m"]].to_numpy(float)
    goals = find_goals(world, places, trajectory["visited"].to_numpy(int))
    captions = make_captions(trajectory, motion, world, context, options, faults)
    cameras = list(place_cameras(motion, world, places, options))
    urdfs = [urdf, *(other.urdf for other in others)]
    with open_scene(urdfs, cut_obstacles(world)) as scene:
        renderer = Renderer(
            scene,
            motion,
            list(make_views(robot, recorded, motion.record, near_m)),
            flag_ends(motion.time_s, len(recorded), faults),
            measure_errors(motion.time_s, len(recorded), faults),
            goals[motion.record],
            context,
            paint_ground(world, places),
            [_move_other(other, times) for other in others],
        )
        for number, (camera, caption) in enumerate(zip(cameras, captions, strict=True)):
            picture = Image.fromarray(renderer.render(number, camera))
            write_caption(picture, caption._replace(states=renderer.colour_sensors(number)))
            yield np.asarray(picture)


def _move_other(other: OtherRobot, times: Array) -> Other:
    robot = read_tree(parse(other.urdf.encode(), "robot.urdf"), "robot.urdf")
    return Other(interpolate(other.trajectory, times, robot), other.context.parts)
