"""The parameters of robots in the plane, and the memory of a mission."""

from typing import NamedTuple

from evoros.base import elementary
from evoros.base.arrays import STATE_SIZE, YAW, Array, Matrix, X, Y
from evoros.base.compilable import inlined
from evoros.base.packing import unpack
from evoros.simulator.engines.planar_bodies import PlanarPose
from evoros.simulator.engines.planar_probes import Probes

STEERING_ANGLE, ROLLED, TURNED, COS, SIN = range(STATE_SIZE, STATE_SIZE + 5)
"""The motion of a robot is its state, then its steering angle [rad], how far its rear axle has
rolled [m] and turned [rad] since the start, and the cosine and sine of its yaw."""
MOTION_SIZE = STATE_SIZE + 5

HULL, SIGHT, PROBES, SIGNALS, CORNERS, TOUCHES, SHAPES = range(7)
"""Where a robot has its parts of ``hulls``, ``sights`` and ``probes``, and its signals, corners of
the outline, touches and shapes."""
PLACES = 7


class Drive(NamedTuple):
    """How a robot moves."""

    steering_gain: float  # share of its error that the steering makes up in one step
    speed_gain: float  # share of its error that the speed makes up in one step
    max_speed: float  # [m/s]
    speed_limit_offset: (
        float  # [m] from the rear axle's centre to the side, to the place that has the limit
    )
    steering_limit: float  # [rad]
    wheelbase: float  # [m]
    rear_axle_x: float  # [m]


class Hull(NamedTuple):
    """The body of a robot, and the obstacles that it may touch, as in ``obstacle_arrays``."""

    radius: float  # [m] from the origin to the farthest corner of the outline
    height: float  # [m]
    mass: float  # [kg], with its sensors
    outline: Matrix  # (k, 2) corners [m]
    grid: Array
    starts: Array  # by cell, its first of the entries
    entries: Array  # rows of the footprints within reach of the outline
    footprints: Matrix
    corners: Matrix  # (c, 2) [m], of the footprints


class Sight(NamedTuple):
    """The sensors of a robot that cast rays, and the obstacles that they may see."""

    beams: Matrix  # (n, BEAM_SIZE)
    groups: Matrix  # (g, GROUP_SIZE)
    rays: Matrix  # (m, 3) unit vectors, in the robot's frame
    steered: Array  # as in steered_sight; empty if no sensor can see a steered wheel
    grid: Array
    starts: Array  # by cell, its first of the entries
    entries: Array  # rows of the obstacles within reach of the sensors
    obstacles: Matrix
    faces: Matrix  # of polyhedra


class Plane(NamedTuple):
    """Robots in a world: the parameters of the planar simulator's rules."""

    time_step: float  # [s]
    drives: Matrix  # a Drive for each robot
    places: Matrix  # (robots + 1, PLACES); the last row has the ends
    hulls: Array  # a packed Hull for each robot
    sights: Array  # a packed Sight for each robot
    probes: Array  # packed Probes for each robot
    shapes: Matrix  # (s, OBSTACLE_SIZE) of each robot in its frame, for the rays of the others
    faces: Matrix  # of polyhedra among these
    movables: Array  # packed Movables


class Memory(NamedTuple):
    """The memory of a mission. The arrays have the parts of each robot one after another."""

    motions: Matrix  # (robots, MOTION_SIZE)
    outlines: Matrix  # (k, 2) corners [m] where a robot would be after the next step
    touches: Array  # how often each contact probe was touched
    shapes: Matrix  # (s, OBSTACLE_SIZE) where the robots are
    movables: Array  # packed Placed


@inlined
def hull_of(parameters: Array, index: int) -> Hull:
    """Return the hull of one of the robots."""
    plane = unpack(Plane, parameters)
    return unpack(Hull, plane.hulls[int(plane.places[index, HULL]) :])


@inlined
def sight_of(parameters: Array, index: int) -> Sight:
    """Return the sight of one of the robots."""
    plane = unpack(Plane, parameters)
    return unpack(Sight, plane.sights[int(plane.places[index, SIGHT]) :])


@inlined
def probes_of(parameters: Array, index: int) -> Probes:
    """Return the probes of one of the robots."""
    plane = unpack(Plane, parameters)
    return unpack(Probes, plane.probes[int(plane.places[index, PROBES]) :])


@inlined
def pose_of(memory: Array, index: int) -> PlanarPose:
    """Return the pose of a robot."""
    motion = unpack(Memory, memory).motions[index]
    return motion[X], motion[Y], motion[COS], motion[SIN]


def place_robot(memory: Memory, index: int, x: float, y: float, yaw: float) -> None:
    """Put a robot at a place [m] and a yaw [rad]."""
    sin, cos = elementary.sin_cos(yaw)
    memory.motions[index, [X, Y, YAW, COS, SIN]] = x, y, yaw, cos, sin
