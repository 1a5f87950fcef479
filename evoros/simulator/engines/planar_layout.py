"""Array layouts of the planar simulator, for its parameters and for the memory of a mission."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evoros.base import elementary
from evoros.base.arrays import STATE_SIZE, YAW, Array, Matrix, X, Y
from evoros.base.compilable import inlined
from evoros.base.packing import unpack
from evoros.compilation.elementary_arrays import atan2_all, cos_all, sin_all
from evoros.robot.model import Robot
from evoros.sensor.protocol import CONTACT, MOTION, WHEELS
from evoros.simulator.engines.planar_bodies import PlanarPose
from evoros.simulator.engines.rays import ZONE_SIZE, Beam, find_zones

PLACE = 0  # first column of every probe, the index of its signal
FRAME, GRAVITY = 1, 8
"""Columns of a motion probe: the frame's position (3,) [m] and quaternion (4,); gravity [m/s2]."""
MOTION_PROBE_SIZE = 9
ZONE = 1  # first column of a contact probe's zone
CONTACT_PROBE_SIZE = ZONE + ZONE_SIZE


class Probes(NamedTuple):
    """The sensors without rays of a robot, as arrays."""

    motion: Matrix  # (p, MOTION_PROBE_SIZE)
    wheels: Array  # indices of wheel signals
    contact: Matrix  # (p, CONTACT_PROBE_SIZE)


def list_probes(robot: Robot, gravity: float) -> Probes:
    """Return the probes of a robot in a world with a gravity [m/s2]."""
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
    """Return the quaternion (w, x, y, z) of a yaw left followed by a nose-up pitch [rad]."""
    sy, cy = elementary.sin_cos(yaw / 2)
    sp, cp = elementary.sin_cos(pitch / 2)
    return cy * cp, sy * sp, -cy * sp, sy * cp


# A row of BEAMS with these columns is a beam, the rays of one channel of a sensor.
ORIGIN, MIN_RANGE, FREE_RANGE, FIRST_RAY, END_RAY, LEFT_EDGE, RIGHT_EDGE = 0, 3, 4, 5, 6, 7, 9
"""Origin (3,) [m]; minimum range [m]; reading without obstacles [m]; index of the first ray and
after the last; outward unit normals (2,) of the left and right edges, 0 without edges.
"""
BEAM_SIZE = 11

# A row of GROUPS with these columns is a group of beams.
FIRST_BEAM, END_BEAM, BEARING, SPACING, REACH = range(5)
"""Index of the first beam and after the last; bearing of the first beam and spacing [rad], left
positive, or zeros unless the beams are single, evenly spaced rays from one origin; maximum range
without obstacles [m].
"""
GROUP_SIZE = 5
_UNEVEN_RAD = 1e-9

STEERING_ANGLE, CURVATURE, ROLLED, TURNED, COS, SIN = range(STATE_SIZE, STATE_SIZE + 6)
"""Columns of motion after the state: steering angle [rad], curvature [1/m], distance [m] and
rotation [rad] of the rear axle since the start, cosine and sine of the yaw.
"""
MOTION_SIZE = STATE_SIZE + 6

HULL, SIGHT, PROBES, SIGNALS, CORNERS, TOUCHES, SHAPES = range(7)
"""Columns of ``places``: start indices in ``hulls``, ``sights`` and ``probes``, and of a robot's
signals, outline corners, touches and shapes.
"""
PLACES = 7


class Drive(NamedTuple):
    """Motion parameters of a robot."""

    steering_gain: float  # fraction of the steering error corrected per step
    speed_gain: float  # fraction of the speed error corrected per step
    steering_mean: float  # mean curvature over a step: 0 is the initial, 1 the final value
    speed_mean: float  # mean speed over a step, on the same scale
    max_speed: float  # [m/s]
    speed_limit_offset: float  # [m], offset of the point that limits the speed from the axle
    steering_limit: float  # [rad]
    wheelbase: float  # [m]
    rear_axle_x: float  # [m]


class Hull(NamedTuple):
    """The body of a robot and obstacles that it may touch, ordered as in ``obstacle_arrays``."""

    radius: float  # [m], distance from the origin to the farthest corner
    height: float  # [m]
    mass: float  # [kg], including sensors
    outline: Matrix  # (k, 2) [m], corners
    grid: Array
    starts: Array  # index of the first entry of each grid cell
    entries: Array  # rows of footprints within reach of an outline in a cell
    footprints: Matrix
    corners: Matrix  # (c, 2) [m], corners of the footprints


class Sight(NamedTuple):
    """The range sensors of a robot, and obstacles that they may detect."""

    beams: Matrix  # (n, BEAM_SIZE)
    groups: Matrix  # (g, GROUP_SIZE)
    rays: Matrix  # (m, 3), unit vectors in the robot's frame
    steered: Array  # a packed ``SteeredSight``; empty if no sensor can detect a steered wheel
    grid: Array
    starts: Array  # index of the first entry of each grid cell
    entries: Array  # rows of obstacles within reach of sensors in a cell
    obstacles: Matrix
    faces: Matrix  # faces of polyhedra


class Plane(NamedTuple):
    """The parameters of the planar simulator's rules for robots in a world."""

    time_step: float  # [s]
    drives: Matrix  # (robots, ...), a Drive per row
    places: Matrix  # (robots + 1, PLACES), the last row holds end indices
    hulls: Array  # a packed Hull per robot
    sights: Array  # a packed Sight per robot
    probes: Array  # packed Probes per robot
    shapes: Matrix  # (s, OBSTACLE_SIZE), robots as detected by other robots, in their own frames
    faces: Matrix  # faces of polyhedra among the shapes
    movables: Array  # packed Movables


class Memory(NamedTuple):
    """The memory of a mission; arrays hold the values of one robot after another."""

    motions: Matrix  # (robots, MOTION_SIZE)
    outlines: Matrix  # (k, 2) [m], corners of the outlines as last placed
    touches: Array  # number of touches of each contact probe
    shapes: Matrix  # (s, OBSTACLE_SIZE), shapes at the poses of the robots
    movables: Array  # packed Placed


@inlined
def hull_of(parameters: Array, index: int) -> Hull:
    """Return the hull of a robot."""
    plane = unpack(Plane, parameters)
    return unpack(Hull, plane.hulls[int(plane.places[index, HULL]) :])


@inlined
def sight_of(parameters: Array, index: int) -> Sight:
    """Return the range sensors of a robot, and obstacles that they may detect."""
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


def beam_rows(robot: Robot, frames: Array, beams: Sequence[Beam], rays: Array) -> Array:
    """Return BEAMS for one frame per mount and the rays of all beams."""
    rows = np.zeros((len(beams), BEAM_SIZE))
    if not len(beams):
        return rows
    ends = np.cumsum([len(beam.directions) for beam in beams])
    rows[:, ORIGIN : ORIGIN + 3] = [beam.origin for beam in beams]
    rows[:, MIN_RANGE] = [beam.range_min for beam in beams]
    rows[:, FIRST_RAY], rows[:, END_RAY] = np.concatenate(([0], ends[:-1])), ends
    first = rows[:, FIRST_RAY].astype(np.int64)
    farthest = np.array([beam.clear_range for beam in beams])
    rows[:, FREE_RANGE] = _free_ranges(rows[:, ORIGIN + 2], rays[:, 2], first, farthest)
    yaws = np.array(list(_facing(robot, frames, np.add.reduceat(rays, first))))
    rows[:, LEFT_EDGE : LEFT_EDGE + 4] = _edges(rays, first, yaws)
    return rows


def _facing(robot: Robot, frames: Array, sums: Array) -> Iterator[float]:
    """Yield the yaw [rad] of each beam: the sensor's or, with several channels, the mean ray's."""
    for part, frame in zip(robot.beam_layout, frames, strict=True):
        if part.stop - part.start == 1:
            yield elementary.atan2(frame[1, 0], frame[0, 0])
        else:
            yield from (elementary.atan2(y, x) for x, y, _ in sums[part].tolist())


def _free_ranges(height: Array, slopes: Array, first: NDArray[np.int64], farthest: Array) -> Array:
    """Return the readings [m] without obstacles: the distance to the ground, up to ``farthest``."""
    drop = -np.minimum.reduceat(slopes, first)
    seen = drop * farthest > height
    return np.where(seen, height / np.where(seen, drop, 1.0), farthest)


def _edges(rays: Array, first: NDArray[np.int64], yaws: Array) -> Array:
    """Return the outward normals (n, 4) of the edges of each beam; zeros if not a wedge."""
    x, y = rays[:, 0], rays[:, 1]
    angles = atan2_all(y, x) - np.repeat(yaws, np.diff([*first, len(rays)]))
    angles = atan2_all(sin_all(angles), cos_all(angles))
    high, low = np.maximum.reduceat(angles, first), np.minimum.reduceat(angles, first)
    wedges = np.minimum.reduceat(np.sqrt(x * x + y * y), first) >= 1e-6
    wedges &= np.maximum(np.abs(high), np.abs(low)) < math.pi / 2
    left, right = yaws + high, yaws + low
    edges = np.column_stack([-sin_all(left), cos_all(left), sin_all(right), -cos_all(right)])
    return edges * wedges[:, None]


def group_rows(robot: Robot, rows: Array, rays: Array) -> Array:
    """Return GROUPS: one per evenly spaced sensor, and one per series of other sensors."""
    groups: list[tuple[float, float, float, float, float]] = []
    for part in robot.beam_layout:
        bearing, spacing = _measure_spacing(rows[part], rays)
        if spacing == 0.0 and groups and groups[-1][SPACING] == 0.0:
            groups[-1] = (groups[-1][FIRST_BEAM], part.stop, 0.0, 0.0, 0.0)
        elif part.start < part.stop:
            reach = float(rows[part, FREE_RANGE].max())
            groups.append((part.start, part.stop, bearing, spacing, reach))
    return np.array(groups).reshape(-1, GROUP_SIZE)


def _measure_spacing(rows: Array, rays: Array) -> tuple[float, float]:
    """Return the first bearing and the spacing [rad] of the beams; zeros if uneven."""
    single = rows[:, END_RAY] - rows[:, FIRST_RAY] == 1.0
    if len(rows) < 2 or not single.all():
        return 0.0, 0.0
    x, y, _ = rays[rows[:, FIRST_RAY].astype(np.int64)].T
    bearings = np.unwrap(atan2_all(y, x))
    spaces = np.diff(bearings)
    spacing = float(spaces.mean())
    even = spacing > 0.0 and np.abs(spaces - spacing).max() < _UNEVEN_RAD
    return (float(bearings[0]), spacing) if even else (0.0, 0.0)
