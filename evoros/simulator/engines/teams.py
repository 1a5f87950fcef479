"""The robots of a simulation: number, names, home frames and array slices."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import COMMAND_SIZE, STATE_SIZE, STRENGTH_SIZE, Array, length, product
from evoros.base.errors import SimulationError
from evoros.drive.protocol import Drive, skids
from evoros.geometry.shapes import Pose
from evoros.robot.model import Robot
from evoros.sensor.protocol import RANGE, SIGNAL_SIZES
from evoros.simulator.protocol import PlacedRobot, Simulator
from evoros.world.floors import ground_height
from evoros.world.model import World

Frame = tuple[tuple[float, ...], tuple[float, ...]]  # position [m], quaternion (x, y, z, w)
MAX_ROBOTS = 16  # one robot per bit in an engine's collision masks


class TeamSimulator(Simulator):
    """A simulator of several robots with all kinds of sensors, walkers and failing wheels."""

    measures = (RANGE, *SIGNAL_SIZES)
    max_robots = MAX_ROBOTS
    has_walkers = True
    weakens_wheels = True


class Share(NamedTuple):
    """The slice of each array that belongs to one robot."""

    state: slice
    command: slice
    strength: slice  # empty unless the simulator supports weakened wheels
    signals: slice


def share_arrays(robots: Sequence[Robot]) -> list[Share]:
    """Return the array slices of each robot, in order."""
    shares, end = [], 0
    for i, robot in enumerate(robots):
        start, end = end, end + robot.signal_count
        state = slice(STATE_SIZE * i, STATE_SIZE * (i + 1))
        command = slice(COMMAND_SIZE * i, COMMAND_SIZE * (i + 1))
        first = COMMAND_SIZE * len(robots) + STRENGTH_SIZE * i
        strength = slice(first, first + STRENGTH_SIZE)
        shares.append(Share(state, command, strength, slice(start, end)))
    return shares


def read_command(commands: Array, share: Share) -> tuple[float, ...]:
    """Return speed [m/s], steering angle [rad] and, if wheels can fail, wheel strengths."""
    return (*commands[share.command].tolist(), *commands[share.strength].tolist())


def sum_others(bit: int, index: int, count: int) -> int:
    """Return the sum of the bits of all robots but one; ``bit`` belongs to the first robot."""
    return sum(bit << other for other in range(count) if other != index)


def check_number(robots: Sequence[PlacedRobot]) -> None:
    """Check that engines can simulate this number of robots."""
    if not 1 <= len(robots) <= MAX_ROBOTS:
        raise SimulationError(f"a world can have 1 to {MAX_ROBOTS} robots, not {len(robots)}")


def doubt_skidding(engine: str, drive: Drive) -> str:
    """Return why a friction pyramid makes an engine inaccurate for a drive, or ""."""
    cause = f"{engine} limits friction along the world's x and y axes"
    effect = "the turn rate of a skid-steer robot depends on its heading"
    return f"{cause}, so {effect}" if skids(drive) else ""


def describe_for_engine(robot: Robot) -> tuple[Any, ...]:
    """Return everything that determines the model of a robot in an engine."""
    drive = robot.drive
    joints = (drive.steering_joints, drive.wheel_joints, drive.caster_links)
    return robot.urdf, robot.engine_text, joints, robot.exposed_links


def name_robots(robots: Sequence[PlacedRobot]) -> str:
    """Return the names of robots for a message, with indices if there are several."""
    if len(robots) == 1:
        return robots[0].robot.name
    return " and ".join(name_robot(i, placed.robot) for i, placed in enumerate(robots))


def name_robot(index: int, robot: Robot) -> str:
    """Return the name of one robot for a message."""
    return f"robot {index} ({robot.name})"


CHASSIS_FRICTION = 1.0  # the chassis touches the ground only when the robot has tipped over
MAX_FRICTION = 1.0
"""Maximum friction coefficient of a body. Many worlds have 100, of which Gazebo uses the smaller of
two; in other engines, wheels would grip far too well.
"""
MAX_POINTS = 12  # maximum number of outline points at which the slope is sampled


def home_frame(robot: Robot, home: tuple[float, float, float, float], world: World) -> Frame:
    """Return the frame of the base link at a home pose: x, y, z [m] and yaw [rad].

    On uneven ground, the robot is tilted like the ground below its outline and lifted clear of it.
    """
    x, y, z, yaw = home
    sin, cos = elementary.sin_cos(yaw)
    level = (x, y, z), (0.0, 0.0, *elementary.sin_cos(yaw / 2))
    if world.is_level:
        return level
    corners = robot.outline[:: -(-len(robot.outline) // MAX_POINTS)]
    around = ((x + cos * a - sin * b, y + sin * a + cos * b) for a, b in corners)
    points = np.array([(x, y), *around])
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
