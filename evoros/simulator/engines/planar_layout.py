"""Array layouts for the planar simulator: its parameters, and the memory of a mission."""

from typing import NamedTuple

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import STATE_SIZE, YAW, Array, Matrix, X, Y
from evoros.base.compilable import inlined
from evoros.base.packing import unpack
from evoros.robot.model import Robot
from evoros.sensor.protocol import CONTACT, MOTION, WHEELS
from evoros.simulator.engines.planar_bodies import PlanarPose
from evoros.simulator.engines.rays import ZONE_SIZE, find_zones

PLACE = 0
"""First column of every probe: the index of its signal."""
FRAME, GRAVITY = 1, 8
"""Columns of a motion probe.

The frame's position (3,) [m] and quaternion (4,), and the gravity [m/s2].
"""
MOTION_PROBE_SIZE = 9
ZONE = 1
"""First column of a contact probe's zone."""
CONTACT_PROBE_SIZE = ZONE + ZONE_SIZE


class Probes(NamedTuple):
    """The sensors of a robot that do not cast rays."""

    motion: Matrix  # (p, MOTION_PROBE_SIZE)
    wheels: Array  # indices of the wheel signals
    contact: Matrix  # (p, CONTACT_PROBE_SIZE)


def list_probes(robot: Robot, gravity: float) -> Probes:
    """Return the probes of a robot in a world with this gravity [m/s2]."""
    motion, wheels, contact, zones = [], [], [], find_zones(robot)
    for index, sensor in enumerate(robot.mounted_sensors()):
        place = float(robot.signal_layout[index].start)
        if sensor.measures == MOTION:
            x, y, z, yaw, pitch = robot.sensor_poses[index].tolist()
            motion.append((place, x, y, z, *_face(yaw, pitch), gravity))
        elif sensor.measures == WHEELS:
            wheels.append(place)
        elif sensor.measures == CONTACT:
            contact.append((place, *zones[index]))
    return Probes(
        np.array(motion).reshape(-1, MOTION_PROBE_SIZE),
        np.array(wheels, dtype=np.float64),
        np.array(contact).reshape(-1, CONTACT_PROBE_SIZE),
    )


def _face(yaw: float, pitch: float) -> tuple[float, float, float, float]:
    """Return the quaternion (w, x, y, z) of a yaw to the left followed by a nose-up pitch [rad]."""
    sy, cy = elementary.sin_cos(yaw / 2)
    sp, cp = elementary.sin_cos(pitch / 2)
    return cy * cp, sy * sp, -cy * sp, sy * cp


STEERING_ANGLE, CURVATURE, ROLLED, TURNED, COS, SIN = range(STATE_SIZE, STATE_SIZE + 6)
"""Columns of a robot's motion after its state.

Steering angle [rad], curvature [1/m], distance [m] and rotation [rad] of its rear axle since the
start, and cosine and sine of its yaw.
"""
MOTION_SIZE = STATE_SIZE + 6

HULL, SIGHT, PROBES, SIGNALS, CORNERS, TOUCHES, SHAPES = range(7)
"""Columns of ``places``.

Start indices of a robot's values in ``hulls``, ``sights`` and ``probes``, and of its signals,
outline corners, touches and shapes.
"""
PLACES = 7


class Drive(NamedTuple):
    """Motion parameters of a robot."""

    steering_gain: float  # fraction of the steering error corrected per step
    speed_gain: float  # fraction of the speed error corrected per step
    steering_mean: float  # mean curvature over a step, from 0 (initial value) to 1 (final value)
    speed_mean: float  # mean speed over a step, on the same scale
    max_speed: float  # [m/s]
    speed_limit_offset: (
        float  # [m], lateral distance from the rear axle's centre to the point with the speed limit
    )
    steering_limit: float  # [rad]
    wheelbase: float  # [m]
    rear_axle_x: float  # [m]


class Hull(NamedTuple):
    """A robot's body and the obstacles that it may touch, in the order of ``obstacle_arrays``."""

    radius: float  # [m], from the origin to the farthest corner of the outline
    height: float  # [m]
    mass: float  # [kg], including sensors
    outline: Matrix  # (k, 2) corners [m]
    grid: Array
    starts: Array  # index of the first entry of each grid cell
    entries: Array  # rows of the footprints that an outline in a cell can reach
    footprints: Matrix
    corners: Matrix  # (c, 2) [m] of the footprints


class Sight(NamedTuple):
    """The range sensors of a robot, and the obstacles that they may see."""

    beams: Matrix  # (n, BEAM_SIZE)
    groups: Matrix  # (g, GROUP_SIZE)
    rays: Matrix  # (m, 3) unit vectors, in the robot's frame
    steered: Array  # a packed ``SteeredSight``; empty if no sensor can see a steered wheel
    grid: Array
    starts: Array  # index of the first entry of each grid cell
    entries: Array  # rows of the obstacles that sensors in a cell can reach
    obstacles: Matrix
    faces: Matrix  # faces of polyhedra


class Plane(NamedTuple):
    """Parameters of the planar simulator's rules for robots in a world."""

    time_step: float  # [s]
    drives: Matrix  # a Drive for each robot
    places: Matrix  # (robots + 1, PLACES); the last row has the end indices
    hulls: Array  # a packed Hull for each robot
    sights: Array  # a packed Sight for each robot
    probes: Array  # packed Probes for each robot
    shapes: Matrix  # (s, OBSTACLE_SIZE), each robot's shapes in its frame, as other robots see them
    faces: Matrix  # faces of polyhedra among the shapes
    movables: Array  # packed Movables


class Memory(NamedTuple):
    """The memory of a mission; each array holds the values of one robot after another."""

    motions: Matrix  # (robots, MOTION_SIZE)
    outlines: Matrix  # (k, 2) [m], corners of the outlines where they were last placed
    touches: Array  # number of touches of each contact probe
    shapes: Matrix  # (s, OBSTACLE_SIZE) at the robots' poses
    movables: Array  # packed Placed


@inlined
def hull_of(parameters: Array, index: int) -> Hull:
    """Return the hull of a robot."""
    plane = unpack(Plane, parameters)
    return unpack(Hull, plane.hulls[int(plane.places[index, HULL]) :])


@inlined
def sight_of(parameters: Array, index: int) -> Sight:
    """Return the range sensors of a robot, and the obstacles that they may see."""
    plane = unpack(Plane, parameters)
    return unpack(Sight, plane.sights[int(plane.places[index, SIGHT]) :])


@inlined
def probes_of(parameters: Array, index: int) -> Probes:
    """Return the probes of a robot."""
    plane = unpack(Plane, parameters)
    return unpack(Probes, plane.probes[int(plane.places[index, PROBES]) :])


@inlined
def pose_of(memory: Array, index: int) -> PlanarPose:
    """Return the pose of a robot."""
    motion = unpack(Memory, memory).motions[index]
    return motion[X], motion[Y], motion[COS], motion[SIN]


def place_robot(memory: Memory, index: int, x: float, y: float, yaw: float) -> None:
    """Set the position [m] and yaw [rad] of a robot."""
    sin, cos = elementary.sin_cos(yaw)
    memory.motions[index, [X, Y, YAW, COS, SIN]] = x, y, yaw, cos, sin
