"""Where a robot stands when a mission starts."""

import math

import numpy as np

from evoros.base import elementary
from evoros.base.linear import length, product
from evoros.geometry.shapes import Pose
from evoros.robot.model import Robot
from evoros.simulator.engines.pybullet_shapes import Frame
from evoros.world.floors import ground_height
from evoros.world.model import World

MAX_POINTS = 12  # of the outline, which tell the slope of the ground below the robot


def home_frame(robot: Robot, home: tuple[float, float, float, float], world: World) -> Frame:
    """The frame of the base link at a home in the world: x, y, z [m] and yaw [rad].

    On level ground it is the home. On other ground the robot is tilted as the ground
    below its outline, and lifted until no part of that ground is above its own.
    """
    x, y, z, yaw = home
    sin, cos = elementary.sin_cos(yaw)
    level = (x, y, z), (0.0, 0.0, *elementary.sin_cos(yaw / 2))
    if world.is_level:
        return level
    corners = robot.outline[:: -(-len(robot.outline) // MAX_POINTS)]
    points = np.array(
        [(x, y), *((x + cos * a - sin * b, y + sin * a + cos * b) for a, b in corners)]
    )
    heights = [(px, py, ground_height(world.bodies, (px, py))) for px, py in points.tolist()]
    ground = np.array([(px - x, py - y, h) for px, py, h in heights if h is not None])
    if len(ground) < 3:
        return level
    slopes = np.column_stack([ground[:, :2], np.ones(len(ground))])
    plane = np.linalg.lstsq(slopes, ground[:, 2], rcond=None)[0]
    above = float((ground[:, 2] - product(slopes, plane)).max())
    up = np.array([-plane[0], -plane[1], 1.0]) / math.hypot(plane[0], plane[1], 1.0)
    forward = np.array([cos, sin, plane[0] * cos + plane[1] * sin])
    forward /= length(forward)
    rotation = np.column_stack([forward, np.cross(up, forward), up])
    position = np.array([x, y, float(plane[2]) + above]) + z * up
    pose = Pose.from_matrix(position.tolist(), rotation)
    return pose.position, pose.quaternion
