"""The sensing rules of robots in the plane, on the arrays of ``planar_layout``.

Compiled and interpreted rules give bitwise equal results. Signals of sensors without rays are
exact, because wheels do not slip in the planar simulator.
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evoros.base import elementary
from evoros.base.arrays import SPEED, YAW, YAW_RATE, Array, Matrix
from evoros.base.compilable import compilable
from evoros.base.packing import unpack
from evoros.compilation.elementary_arrays import atan2_all, cos_all, sin_all
from evoros.geometry import ray
from evoros.geometry.grid import cell_at
from evoros.geometry.ray import Point, cast_rays, is_beside, is_beyond, place_obstacle, turn_frame
from evoros.robot.model import Robot
from evoros.sensor import signals as signal
from evoros.simulator.engines import planar_layout as layout
from evoros.simulator.engines.planar_bodies import Movables, Placed, PlanarPose
from evoros.simulator.engines.planar_layout import (
    FRAME,
    GRAVITY,
    PLACE,
    Drive,
    Memory,
    Plane,
    pose_of,
    probes_of,
    sight_of,
)
from evoros.simulator.engines.rays import Beam, see_parts_at

FULL_TURN = 2.0 * math.pi

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
Indices = NDArray[np.int64]


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


def _free_ranges(height: Array, slopes: Array, first: Indices, farthest: Array) -> Array:
    """Return the readings [m] without obstacles: the distance to the ground, or ``farthest``."""
    drop = -np.minimum.reduceat(slopes, first)
    seen = drop * farthest > height
    return np.where(seen, height / np.where(seen, drop, 1.0), farthest)


def _edges(rays: Array, first: Indices, yaws: Array) -> Array:
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


@compilable
def find_span(group: Array, x: float, y: float, radius: float) -> tuple[float, float]:
    """Return the index range of an even group's beams that may hit a circle.

    (x, y) [m] is the circle's centre relative to the beams' origin. The range may be shifted by a
    full turn.
    """
    squared = x * x + y * y
    if squared <= radius * radius:
        return 0.0, group[END_BEAM] - group[FIRST_BEAM]
    half = elementary.asin(radius / math.sqrt(squared))
    middle = elementary.atan2(y, x) - group[BEARING]
    if middle < 0.0:
        middle += FULL_TURN
    # Extend the range by one beam on each side, to allow for rounding.
    return (middle - half) / group[SPACING] - 1.0, (middle + half) / group[SPACING] + 1.0


@compilable
def fill_signals(parameters: Array, memory: Array, index: int, signals: Array) -> None:
    """Write the signal of each of a robot's probes."""
    probes, now = probes_of(parameters, index), unpack(Memory, memory)
    motion = now.motions[index]
    for i in range(len(probes.motion)):
        fill_motion(parameters, memory, index, probes.motion[i], signals)
    for i in range(len(probes.wheels)):
        place = int(probes.wheels[i])
        signals[place + signal.DISTANCE] = motion[layout.ROLLED]
        signals[place + signal.TURN] = motion[layout.TURNED]
    touched = int(unpack(Plane, parameters).places[index, layout.TOUCHES])
    for i in range(len(probes.contact)):
        place = int(probes.contact[i, PLACE])
        signals[place + signal.TOUCHES] = now.touches[touched + i]


@compilable
def fill_motion(parameters: Array, memory: Array, index: int, probe: Array, signals: Array) -> None:
    """Write the motion of a probe's frame on a robot."""
    motion = unpack(Memory, memory).motions[index]
    drive = unpack(Drive, unpack(Plane, parameters).drives[index])
    x, y, cos, sin = pose_of(memory, index)
    signals = signals[int(probe[PLACE]) :]
    px = probe[FRAME]
    py = probe[FRAME + 1]
    signals[signal.POSITION] = x + cos * px - sin * py
    signals[signal.POSITION + 1] = y + sin * px + cos * py
    signals[signal.POSITION + 2] = probe[FRAME + 2]
    # The robot's yaw rotation times the sensor's mounting rotation.
    z, w = elementary.sin_cos(0.5 * motion[YAW])
    qw = probe[FRAME + 3]
    qx = probe[FRAME + 4]
    qy = probe[FRAME + 5]
    qz = probe[FRAME + 6]
    signals[signal.ORIENTATION] = w * qw - z * qz
    signals[signal.ORIENTATION + 1] = w * qx - z * qy
    signals[signal.ORIENTATION + 2] = w * qy + z * qx
    signals[signal.ORIENTATION + 3] = w * qz + z * qw
    # The rear axle moves along the robot's heading.
    ahead = motion[SPEED] - motion[YAW_RATE] * py
    aside = motion[YAW_RATE] * (px - drive.rear_axle_x)
    signals[signal.VELOCITY] = cos * ahead - sin * aside
    signals[signal.VELOCITY + 1] = sin * ahead + cos * aside
    signals[signal.VELOCITY + 2] = 0.0
    signals[signal.TURNING] = 0.0
    signals[signal.TURNING + 1] = 0.0
    signals[signal.TURNING + 2] = motion[YAW_RATE]
    signals[signal.GRAVITY] = probe[GRAVITY]


class Sensors(NamedTuple):
    """A robot's sensors and pose, and the ranges found so far."""

    beams: Matrix
    groups: Matrix
    rays: Matrix
    pose: PlanarPose
    ranges: Array  # [m], one per beam; obstacles shorten them


@compilable
def sense(parameters: Array, memory: Array, signals: Array) -> None:
    """Fill ``signals`` with the range [m] of each beam of all robots, within its limits."""
    places = unpack(Plane, parameters).places
    place_shapes(parameters, memory)
    for i in range(len(places) - 1):
        see(parameters, memory, i, signals[int(places[i, layout.SIGNALS]) :])


def sense_signals(parameters: Array, memory: Array, signals: Array) -> None:
    """Fill ``signals`` like ``sense``, and include the signals of sensors without rays.

    This takes a sixth longer to compile than ``sense``, which is enough for most first runs.
    """
    sense(parameters, memory, signals)
    places = unpack(Plane, parameters).places
    for i in range(len(places) - 1):
        fill_signals(parameters, memory, i, signals[int(places[i, layout.SIGNALS]) :])


@compilable
def place_shapes(parameters: Array, memory: Array) -> None:
    """Move the shapes of the robots to the robots' poses."""
    plane, placed = unpack(Plane, parameters), unpack(Memory, memory).shapes
    for i in range(len(plane.drives)):
        x, y, cos, sin = pose_of(memory, i)
        for k in range(
            int(plane.places[i, layout.SHAPES]), int(plane.places[i + 1, layout.SHAPES])
        ):
            place_obstacle(plane.shapes[k], x, y, cos, sin, placed[k])


@compilable
def see(parameters: Array, memory: Array, index: int, ranges: Array) -> None:
    """Write the range [m] of each beam of a robot."""
    plane, now = unpack(Plane, parameters), unpack(Memory, memory)
    sight = sight_of(parameters, index)
    beams = sight.beams
    for i in range(len(beams)):
        ranges[i] = beams[i, FREE_RANGE]
    if len(sight.steered) > 0:
        see_parts_at(sight.steered, now.motions[index, layout.STEERING_ANGLE], ranges)
    pose = pose_of(memory, index)
    sensors = Sensors(beams, sight.groups, sight.rays, pose, ranges)
    cell = cell_at(sight.grid, pose[0], pose[1])
    if cell >= 0:
        for entry in range(int(sight.starts[cell]), int(sight.starts[cell + 1])):
            detect(sight.obstacles[int(sight.entries[entry])], sight.faces, sensors)
    faces = unpack(Movables, plane.movables).faces
    detect_all(unpack(Placed, now.movables).sights, faces, sensors)
    for other in range(len(now.motions)):
        if other != index:
            start = int(plane.places[other, layout.SHAPES])
            end = int(plane.places[other + 1, layout.SHAPES])
            detect_all(now.shapes[start:end], plane.faces, sensors)
    for i in range(len(beams)):
        if ranges[i] < beams[i, MIN_RANGE]:
            ranges[i] = beams[i, MIN_RANGE]


@compilable
def detect_all(obstacles: Array, faces: Array, sensors: Sensors) -> None:
    """Shorten the range of each beam that sees one of the obstacles."""
    for i in range(len(obstacles)):
        detect(obstacles[i], faces, sensors)


@compilable
def detect(obstacle: Array, faces: Array, sensors: Sensors) -> None:
    """Shorten the range of each beam that sees this obstacle."""
    x, y, cos, sin = sensors.pose
    dx = obstacle[ray.AT_X] - x
    dy = obstacle[ray.AT_Y] - y
    centre = cos * dx + sin * dy, cos * dy - sin * dx, obstacle[ray.AT_Z]
    for i in range(len(sensors.groups)):
        group = sensors.groups[i]
        if group[SPACING] == 0.0:
            cast_beams(obstacle, faces, sensors, group, centre)
        else:
            cast_group(obstacle, faces, sensors, group, centre)


@compilable
def cast_group(
    obstacle: Array, faces: Array, sensors: Sensors, group: Array, centre: Point
) -> None:
    """Shorten the ranges of an even group's beams; ``centre`` is relative to the robot."""
    first_beam, end_beam = int(group[FIRST_BEAM]), int(group[END_BEAM])
    px, py, pz = find_centre(centre, sensors.beams[first_beam])
    reach = group[REACH] + obstacle[ray.BOUND]
    if px * px + py * py >= reach * reach:
        return
    _, _, cos, sin = sensors.pose
    first_ray = int(sensors.beams[first_beam, FIRST_RAY])
    low, high = find_span(group, px, py, obstacle[ray.BOUND])
    turn = FULL_TURN / group[SPACING]
    for k in range(-1, 2):
        start = max(int(low + k * turn), 0)
        end = min(int(high + k * turn) + 1, end_beam - first_beam)
        if start < end:
            rays = sensors.rays[first_ray + start : first_ray + end]
            ranges = sensors.ranges[first_beam + start : first_beam + end]
            frame = turn_frame(obstacle, cos, sin)
            cast_rays(obstacle, faces, frame, (-px, -py, -pz), rays, math.inf, ranges)


@compilable
def find_centre(centre: Point, row: Array) -> Point:
    """Return the centre of an obstacle relative to a beam's origin."""
    x, y, z = centre
    return x - row[ORIGIN], y - row[ORIGIN + 1], z - row[ORIGIN + 2]


@compilable
def cast_beams(
    obstacle: Array, faces: Array, sensors: Sensors, group: Array, centre: Point
) -> None:
    """Shorten the ranges of an unevenly spaced group's beams; see ``cast_group``."""
    _, _, cos, sin = sensors.pose
    ranges, bound = sensors.ranges, obstacle[ray.BOUND]
    for i in range(int(group[FIRST_BEAM]), int(group[END_BEAM])):
        row = sensors.beams[i]
        px, py, pz = find_centre(centre, row)
        left_x, left_y = row[LEFT_EDGE], row[LEFT_EDGE + 1]
        right_x, right_y = row[RIGHT_EDGE], row[RIGHT_EDGE + 1]
        # Skip the rays if the circle around the obstacle is out of range or outside the beam.
        far = ranges[i] + bound
        if px * px + py * py >= far * far:
            continue
        if px * left_x + py * left_y > bound or px * right_x + py * right_y > bound:
            continue
        frame = turn_frame(obstacle, cos, sin)
        if obstacle[ray.KIND] == ray.BOX and (
            is_beside(obstacle, frame, px, py, left_x, left_y)
            or is_beside(obstacle, frame, px, py, right_x, right_y)
            or is_beyond(obstacle, frame, (px, py, pz), ranges[i])
        ):
            continue
        rays = sensors.rays[int(row[FIRST_RAY]) : int(row[END_RAY])]
        origin = (-px, -py, -pz)
        ranges[i] = cast_rays(obstacle, faces, frame, origin, rays, ranges[i], ranges[:0])
