"""Renders a mission as a video of the robot, obstacles and sensor readings."""

import argparse
import math
import re
import sys
import tempfile
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from fractions import Fraction
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from PIL import Image

from evoros.analysis.subcommands import Product, add_run
from evoros.analysis.tables.records import Record, read_record
from evoros.analysis.tables.study import Study
from evoros.base.errors import InputError, require_extra
from evoros.plugins.recordings.missions import (
    RecordedMission,
    place_champion,
    read_champion_mission,
)
from evoros.plugins.recordings.video import renderer as rendering
from evoros.plugins.recordings.video.camera import (
    CAMERAS,
    Pixels,
    RenderOptions,
    make_captions,
    place_cameras,
    sample_times,
)
from evoros.plugins.recordings.video.captions import write_caption
from evoros.plugins.recordings.video.motion import interpolate
from evoros.plugins.recordings.video.scene import Scene
from evoros.plugins.recordings.video.sensors import make_views
from evoros.storage.reading import Run

# Bit-exact files contain no dates or versions; with the index first, they play while loading.
_CONTAINER = {"fflags": "+bitexact", "movflags": "+faststart"}
# A video at crf 18 looks like the original; at 28, artefacts are visible. Macroblock trees would
# make x264 encode equal pictures differently.
_CODEC = {"crf": "21", "preset": "fast", "x264-params": "mbtree=0"}


def film(mission: RecordedMission, options: RenderOptions | None = None) -> Iterator[Pixels]:
    """Yield the pictures (h, w, 3) of a mission."""
    options = options or RenderOptions()
    robots = list(mission.others.values())
    urdfs = [mission.loaded_urdf, *(other.loaded_urdf for other in robots)]
    obstacles, walkers = rendering.cut_obstacles(mission.world), mission.walkers
    scene = Scene(urdfs, obstacles, rendering.shape_walkers(walkers))
    robot, *others = (shown.tree for shown in scene.robots)
    times = sample_times(mission.trajectory, options)
    motion = interpolate(mission.trajectory, times, robot)
    sensors = list(make_views(robot, mission, times, motion.record))
    places = mission.trajectory[["x_m", "y_m"]].to_numpy(float)
    goals = rendering.find_goals(mission.world, places, mission.trajectory["visited"].to_numpy(int))
    renderer = rendering.Renderer(
        scene,
        motion,
        sensors,
        goals[motion.record],
        mission.context,
        rendering.paint_ground(mission.world, places),
        [
            rendering.Other(interpolate(other.trajectory, times, tree), other.context.parts)
            for other, tree in zip(robots, others, strict=True)
        ],
        [np.stack([np.interp(times, w.time_s, c) for c in w.places.T], axis=1) for w in walkers],
    )
    cameras = place_cameras(motion, mission.world, places, options)
    captions = make_captions(mission, motion, options)
    for index, (camera, caption) in enumerate(zip(cameras, captions, strict=True)):
        picture = Image.fromarray(renderer.render(index, camera))
        states = [tuple(sensor.colours[index].tolist()) for sensor in sensors]
        write_caption(picture, caption._replace(states=states))
        yield np.asarray(picture)


def encode_mp4(pictures: Iterable[Pixels], fps: float) -> bytes:
    """Encode at least one picture (h, w, 3) of even width and height as H.264."""
    with require_extra("video", "evoros analyze video"):
        import av
    source = iter(pictures)
    first = next(source)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "video.mp4"
        with av.open(str(path), "w", format="mp4", container_options=_CONTAINER) as container:
            rate = Fraction(fps).limit_denominator(1000)
            stream = container.add_stream("libx264", rate=rate, options=_CODEC)
            stream.height, stream.width = first.shape[:2]
            stream.pix_fmt = "yuv420p"  # browsers and presentation programs require this format
            stream.codec_context.thread_count = 1  # otherwise, the file depends on the core count
            stream.codec_context.flags |= av.codec.context.Flags.bitexact

            def encode(picture: Pixels) -> None:
                container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))

            with ThreadPoolExecutor(1) as pool:  # encodes one picture while the next is drawn
                last = pool.submit(encode, first)
                for picture in source:
                    last.result()
                    last = pool.submit(encode, picture)
                last.result()
            container.mux(stream.encode(None))
        return path.read_bytes()


def film_champion(
    run: Run, world: str, trajectory: pd.DataFrame, options: RenderOptions | None = None
) -> bytes:
    """Return an MP4 video of a champion's mission, which may have been replayed.

    ``trajectory`` has the columns of ``champion/trajectory_WORLD.csv``. If the world is redrawn for
    each mission, the video shows the world of the champion's first mission.
    """
    shown = options or RenderOptions()
    mission = place_champion(read_record(run.path, run.path.name), world, trajectory)
    mission = replace(mission, faults=(), part_failures=())
    return encode_mp4(film(mission, shown), shown.fps)


ONE_ROBOT = IN_VIEW = True  # shows one robot with sensors, and other robots without
WORST_MISSION = True
HELP = "a video of one of the champion's missions, with its sensor readings"
NEEDS = "a finished run, or an evaluation, that recorded trajectories"
FILES = ("video.mp4",)
FORMATS: dict[str, str] = {}
_OPTION_NAMES = {"start_s": "--from", "end_s": "--to"}  # options not named after their field


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for the mission and the camera."""
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
    """Make the video of the named run's champion (default: the best run's)."""
    study.check_worlds([options.world] if options.world else [])
    record, mission = study.choose(options.run, partial(_read, world=options.world))
    chosen = _parse_options(options, mission.name)
    count = len(sample_times(mission.trajectory, chosen))
    video = encode_mp4(_show_progress(film(mission, chosen), count), chosen.fps)
    message = f"{record.name}: the champion in {mission.name}, at {chosen.speed:g} times real time"
    return Product(messages=[message], files={"video.mp4": video})


def _read(record: Record, world: str | None) -> RecordedMission:
    """Read the champion's mission in the named world, or in the first world."""
    courses = record.context.courses
    if world not in (None, *courses):
        raise InputError(
            f"{record.path}: world {world!r} not found; choose one of {', '.join(courses)}"
        )
    return read_champion_mission(record, world or next(iter(courses)))


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
