"""Films missions and encodes the pictures; on one machine, equal pictures give equal bytes."""

import tempfile
from collections.abc import Iterable, Iterator
from fractions import Fraction
from itertools import chain
from pathlib import Path

import numpy as np
import pandas as pd
from PIL import Image

from evoros.analysis.tables.readings import read_sensors
from evoros.analysis.tables.records import read_record
from evoros.base.errors import require_extra
from evoros.plugins.recordings.video import renderer as rendering
from evoros.plugins.recordings.video.camera import (
    Pixels,
    RenderOptions,
    make_captions,
    place_cameras,
    sample_times,
)
from evoros.plugins.recordings.video.captions import write_caption
from evoros.plugins.recordings.video.mission import (
    FilmedMission,
    check_poses,
    flag_ends,
    interpolate,
    measure_errors,
    place_trajectory,
)
from evoros.plugins.recordings.video.scene import Scene
from evoros.plugins.recordings.video.sensors import make_views
from evoros.storage.reading import Run

# Bit-exact files contain no dates and no encoder names or versions. The index comes first, so that
# the video plays while loading.
_CONTAINER = {"fflags": "+bitexact", "movflags": "+faststart"}
_CODEC = {"crf": "21", "preset": "fast"}  # 18 looks like the original; 28 has visible artefacts


def film(mission: FilmedMission, options: RenderOptions | None = None) -> Iterator[Pixels]:
    """Yield the pictures (h, w, 3) of a mission."""
    check_poses(mission.trajectory)
    options = options or RenderOptions()
    urdfs = [mission.urdf, *(other.urdf for other in mission.others)]
    obstacles, walkers = rendering.cut_obstacles(mission.world), mission.walkers
    scene = Scene(urdfs, obstacles, rendering.shape_walkers(walkers))
    robot, *others = (shown.tree for shown in scene.robots)
    times = sample_times(mission.trajectory, options)
    sensors = read_sensors(mission.trajectory, robot.poses, mission.context, "robot.urdf")
    motion = interpolate(mission.trajectory, times, robot)
    places = mission.trajectory[["x_m", "y_m"]].to_numpy(float)
    goals = rendering.find_goals(mission.world, places, mission.trajectory["visited"].to_numpy(int))
    renderer = rendering.Renderer(
        scene,
        motion,
        list(make_views(robot, sensors, motion.record, mission.near_m)),
        flag_ends(times, len(sensors), mission.faults),
        measure_errors(times, len(sensors), mission.faults),
        goals[motion.record],
        mission.context,
        rendering.paint_ground(mission.world, places),
        [
            rendering.Other(interpolate(other.trajectory, times, tree), other.context.parts)
            for other, tree in zip(mission.others, others, strict=True)
        ],
        [np.stack([np.interp(times, w.time_s, c) for c in w.places.T], axis=1) for w in walkers],
    )
    cameras = place_cameras(motion, mission.world, places, options)
    captions = make_captions(mission, motion, options)
    for index, (camera, caption) in enumerate(zip(cameras, captions, strict=True)):
        picture = Image.fromarray(renderer.render(index, camera))
        write_caption(picture, caption._replace(states=renderer.colour_sensors(index)))
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
            stream.pix_fmt = "yuv420p"  # the format that browsers and slide programs play
            stream.codec_context.thread_count = 1  # otherwise, the file depends on the cores
            stream.codec_context.flags |= av.codec.context.Flags.bitexact
            for picture in chain([first], source):
                container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
            container.mux(stream.encode(None))
        return path.read_bytes()


def film_champion(
    run: Run, world: str, trajectory: pd.DataFrame, options: RenderOptions | None = None
) -> bytes:
    """Return an MP4 film of any mission of a run's champion, such as a replayed one.

    ``trajectory`` has the columns of ``champion/trajectory_WORLD.csv``. A world that is redrawn
    for each mission is shown as in the champion's first mission.
    """
    shown = options or RenderOptions()
    mission = place_trajectory(read_record(run.path, run.path.name), world, trajectory)
    return encode_mp4(film(mission, shown), shown.fps)
