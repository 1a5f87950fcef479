"""Array layouts for the planar simulator: its parameters, and the memory of a mission."""

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

PLACE = 0  # first column of every probe: the index of its signal
FRAME, GRAVITY = 1, 8
"""Columns of a motion probe.

The frame's position (3,) [m] and quaternion (4,), and the gravity [m/s2].
"""
MOTION_PROBE_SIZE = 9
ZONE = 1  # first column of a contact probe's zone
CONTACT_PROBE_SIZE = ZONE + ZONE_SIZE


class Probes(NamedTuple):
    """A robot's sensors without rays, as arrays."""

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


# A beam, that is, a channel of a sensor, is a row of BEAMS with these columns.
ORIGIN, MIN_RANGE, FREE_RANGE, FIRST_RAY, END_RAY, LEFT_EDGE, RIGHT_EDGE = 0, 3, 4, 5, 6, 7, 9
"""Columns of BEAMS.

Origin (3,) [m]; minimum range [m]; reading without obstacles [m]; first ray; end of its rays;
outward unit normals (2,) of the beam's left and right edge, or 0 without edges.
"""
BEAM_SIZE = 11

# A group of beams is a row of GROUPS with these columns.
FIRST_BEAM, END_BEAM, BEARING, SPACING, REACH = range(5)
"""Columns of GROUPS.

First beam; end of its beams; bearing of the first beam and spacing [rad], positive to the left, or
zeros unless the beams are single, evenly spaced rays from one origin; maximum range without
obstacles [m].
"""
GROUP_SIZE = 5
_UNEVEN_RAD = 1e-9

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
    # [m], lateral distance from the rear axle's centre to the point with the speed limit
    speed_limit_offset: float
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


def beam_rows(robot: Robot, frames: Array, beams: Sequence[Beam], rays: Array) -> Array:
    """Return BEAMS from one frame per mount and the rays of all beams."""
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
    """Yield each beam's yaw [rad]: the sensor's or, with several channels, the mean ray's."""
    for part, frame in zip(robot.beam_layout, frames, strict=True):
        if part.stop - part.start == 1:
            yield elementary.atan2(frame[1, 0], frame[0, 0])
        else:
            yield from (elementary.atan2(y, x) for x, y, _ in sums[part].tolist())


def _free_ranges(height: Array, slopes: Array, first: NDArray[np.int64], farthest: Array) -> Array:
    """Return the readings [m] without obstacles: the distance to the ground, or ``farthest``."""
    drop = -np.minimum.reduceat(slopes, first)
    seen = drop * farthest > height
    return np.where(seen, height / np.where(seen, drop, 1.0), farthest)


def _edges(rays: Array, first: NDArray[np.int64], yaws: Array) -> Array:
    """Return the outward unit normals (n, 4) of each beam's edges; zeros if it is no wedge."""
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
    """Return GROUPS, one for each evenly spaced sensor and one for each run of other sensors."""
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
    """Return the first beam's bearing and the spacing [rad]; zeros if unevenly spaced."""
    single = rows[:, END_RAY] - rows[:, FIRST_RAY] == 1.0
    if len(rows) < 2 or not single.all():
        return 0.0, 0.0
    x, y, _ = rays[rows[:, FIRST_RAY].astype(np.int64)].T
    bearings = np.unwrap(atan2_all(y, x))
    spaces = np.diff(bearings)
    spacing = float(spaces.mean())
    even = spacing > 0.0 and np.abs(spaces - spacing).max() < _UNEVEN_RAD
    return (float(bearings[0]), spacing) if even else (0.0, 0.0)
