"""Films missions: the robot among its obstacles, with the readings of its sensors."""

from collections.abc import Iterator

import numpy as np
from PIL import Image

from evoros.base.arrays import Array
from evoros.formats.strict_xml import parse
from evoros.formats.urdf.tree import Urdf, read_tree
from evoros.simulator.engines.pybullet_viewer import open_scene

from ..tables.readings import read_sensors
from .camera import Pixels
from .captions import write_caption
from .faults import flag_ends, measure_errors
from .mission import FilmedMission, OtherRobot
from .motion import check_poses, interpolate
from .render_options import RenderOptions, make_captions, place_cameras, sample_times
from .renderer import Other, Renderer, cut_obstacles, find_goals, paint_ground
from .sensors import make_views


def film(mission: FilmedMission, options: RenderOptions | None = None) -> Iterator[Pixels]:
    """Yield the pictures (h, w, 3) of a mission.

    Raises:
        InputError: PyBullet is not installed, or the trajectory does not fit.
    """
    check_poses(mission.trajectory)
    options = options or RenderOptions()
    robot, times = _read_robot(mission.urdf), sample_times(mission.trajectory, options)
    sensors = read_sensors(mission.trajectory, robot.poses, mission.context, "robot.urdf")
    motion = interpolate(mission.trajectory, times, robot)
    places = mission.trajectory[["x_m", "y_m"]].to_numpy(float)
    goals = find_goals(mission.world, places, mission.trajectory["visited"].to_numpy(int))
    captions = make_captions(mission, motion, options)
    cameras = list(place_cameras(motion, mission.world, places, options))
    urdfs = [mission.urdf, *(other.urdf for other in mission.others)]
    with open_scene(urdfs, cut_obstacles(mission.world)) as scene:
        renderer = Renderer(
            scene,
            motion,
            list(make_views(robot, sensors, motion.record, mission.near_m)),
            flag_ends(times, len(sensors), mission.faults),
            measure_errors(times, len(sensors), mission.faults),
            goals[motion.record],
            mission.context,
            paint_ground(mission.world, places),
            [_move_other(other, times) for other in mission.others],
        )
        for index, (camera, caption) in enumerate(zip(cameras, captions, strict=True)):
            picture = Image.fromarray(renderer.render(index, camera))
            write_caption(picture, caption._replace(states=renderer.colour_sensors(index)))
            yield np.asarray(picture)


def _read_robot(urdf: str) -> Urdf:
    return read_tree(parse(urdf.encode(), "robot.urdf"), "robot.urdf")


def _move_other(other: OtherRobot, times: Array) -> Other:
    motion = interpolate(other.trajectory, times, _read_robot(other.urdf))
    return Other(motion, other.context.parts)
