"""Films missions: the robot among its obstacles, with the readings of its sensors."""

from collections.abc import Iterator

import numpy as np
from PIL import Image

from ..tables.readings import read_sensors
from .camera import Pixels
from .captions import write_caption
from .faults import flag_ends, measure_errors
from .mission import FilmedMission
from .motion import check_poses, interpolate, interpolate_places
from .render_options import RenderOptions, make_captions, place_cameras, sample_times
from .renderer import Other, Renderer, cut_obstacles, find_goals, paint_ground, shape_walkers
from .scene import Scene
from .sensors import make_views


def film(mission: FilmedMission, options: RenderOptions | None = None) -> Iterator[Pixels]:
    """Yield the pictures (h, w, 3) of a mission.

    Raises:
        InputError: the trajectory or a URDF does not fit.
    """
    check_poses(mission.trajectory)
    options = options or RenderOptions()
    urdfs = [mission.urdf, *(other.urdf for other in mission.others)]
    scene = Scene(urdfs, cut_obstacles(mission.world), shape_walkers(mission.walkers))
    robot, *others = (shown.tree for shown in scene.robots)
    times = sample_times(mission.trajectory, options)
    sensors = read_sensors(mission.trajectory, robot.poses, mission.context, "robot.urdf")
    motion = interpolate(mission.trajectory, times, robot)
    places = mission.trajectory[["x_m", "y_m"]].to_numpy(float)
    goals = find_goals(mission.world, places, mission.trajectory["visited"].to_numpy(int))
    renderer = Renderer(
        scene,
        motion,
        list(make_views(robot, sensors, motion.record, mission.near_m)),
        flag_ends(times, len(sensors), mission.faults),
        measure_errors(times, len(sensors), mission.faults),
        goals[motion.record],
        mission.context,
        paint_ground(mission.world, places),
        [
            Other(interpolate(other.trajectory, times, tree), other.context.parts)
            for other, tree in zip(mission.others, others, strict=True)
        ],
        [interpolate_places(walker, times) for walker in mission.walkers],
    )
    cameras = place_cameras(motion, mission.world, places, options)
    captions = make_captions(mission, motion, options)
    for index, (camera, caption) in enumerate(zip(cameras, captions, strict=True)):
        picture = Image.fromarray(renderer.render(index, camera))
        write_caption(picture, caption._replace(states=renderer.colour_sensors(index)))
        yield np.asarray(picture)
