"""Beams of range sensors, contact zones, and steered parts in view, for all engines."""

import math
from typing import NamedTuple

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array, Matrix
from evoros.base.compilable import compilable
from evoros.base.packing import pack, unpack
from evoros.compilation.rules import A1, NOTHING, compile_rule
from evoros.drive.protocol import Drive
from evoros.geometry.ray import AT_X, AT_Y, AT_Z, OBSTACLE_SIZE, turn_frame
from evoros.robot.model import DIRECTION, LIMIT, ORIGIN, Robot
from evoros.robot.outline import relative_row
from evoros.robot.self_sight import cast_at_robot, measure_clear_ranges, meet_shape
from evoros.sensor.protocol import feels, sees


class Beam(NamedTuple):
    """The rays of one channel of a mounted sensor; its range is the nearest hit."""

    origin: Array  # (3,) [m]
    directions: Array  # (k, 3) unit vectors
    range_min: float  # [m]
    range_max: float  # [m]
    clear_range: float  # [m], reading without obstacles: range_max, or the distance to the robot


def sensor_beams(robot: Robot) -> list[Beam]:
    """Return a beam for each channel of range sensors, in the order of the true ranges."""
    rows, starts = robot.ray_table
    lowest = [
        sensor.range_min_m
        for sensor in robot.mounted_sensors()
        if sees(sensor)
        for _ in sensor.channels
    ]
    clear = measure_clear_ranges(robot).tolist()
    return [
        Beam(
            rows[first, ORIGIN : ORIGIN + 3],
            rows[first:end, DIRECTION : DIRECTION + 3],
            range_min,
            float(rows[first, LIMIT]),
            clear_range,
        )
        for first, end, range_min, clear_range in zip(
            starts[:-1].tolist(), starts[1:].tolist(), lowest, clear, strict=True
        )
    ]


class Zone(NamedTuple):
    """The zone of a mounted contact sensor in top view, in the robot's frame."""

    x: float  # [m], position of the mount
    y: float
    cos: float  # cosine of the direction the sensor faces
    sin: float
    depth: float  # [m]
    width: float  # [m]


ZONE_SIZE = len(Zone._fields)


def find_zones(robot: Robot) -> dict[int, Zone]:
    """Return the contact zones of a robot, by mount index."""
    zones, frames = {}, robot.sensor_frames
    for index, sensor in enumerate(robot.mounted_sensors()):
        if feels(sensor):
            x, y, across = float(frames[index, 0, 3]), float(frames[index, 1, 3]), frames[index]
            # The left axis of the mount stays level under pitch.
            cos, sin = float(across[1, 1]), -float(across[0, 1])
            zones[index] = Zone(x, y, cos, sin, float(sensor.depth_m), float(sensor.width_m))
    return zones


@compilable
def crosses_zone(zone: Zone, ax: float, ay: float, bx: float, by: float) -> bool:
    """Return True if the segment from a to b [m], in the robot's frame, intersects a zone."""
    x, y, cos, sin, depth, width = zone
    start = 0.0
    end = 1.0
    ahead = cos * (ax - x) + sin * (ay - y) + depth
    aside = cos * (ay - y) - sin * (ax - x)
    forward = cos * (bx - ax) + sin * (by - ay)
    leftward = cos * (by - ay) - sin * (bx - ax)
    half = 0.5 * width
    for side in range(3):
        # how far the segment's start is inside this side of the zone, and how much farther its end
        if side == 0:
            inside = ahead
            gain = forward
        elif side == 1:
            inside = half - aside
            gain = -leftward
        else:
            inside = half + aside
            gain = leftward
        if gain == 0.0:
            if inside < 0.0:
                return False
        elif gain > 0.0:
            start = max(start, -inside / gain)
        else:
            end = min(end, -inside / gain)
    return start <= end


JOINT, PIVOT, NARROWING, INSIDE, ROLLS, SHAPE = 0, 1, 3, 4, 5, 6
"""Columns of a steered part: index of the steering joint; x, y [m] of its vertical axis;
``narrowing_of``; ``inside`` and ``rolls`` as in ``OccluderRows``; ray row relative to the axis.
"""
PART_SIZE = SHAPE + OBSTACLE_SIZE
PART, BEAM, FIRST_RAY, END_RAY = range(4)  # columns of a beam; END: after the last ray
PAIR_SIZE = 4


class SteeredSight(NamedTuple):
    """The steered parts of a robot that its sensors may detect."""

    parts: Matrix  # (p, PART_SIZE)
    pairs: Matrix  # (q, PAIR_SIZE)
    rays: Matrix  # (r, RAY_SIZE)
    backward: Matrix  # (r, 3), reversed ray directions
    faces: Matrix  # (f, FACE_SIZE)


def lay_out_steered_sight(robot: Robot, clear_ranges: Array) -> Array:
    """Pack a robot's ``SteeredSight``; ``clear_ranges`` (n,) [m] has one value per beam."""
    steered, (rays, starts) = robot.occluders.steered, robot.ray_table
    if not len(steered.rows) or not len(rays):
        return np.zeros(0)
    parts: list[Array] = []
    pairs: list[tuple[int, int, int, int]] = []
    for index, volume in enumerate(robot.occluders.sweep_volumes):
        distances, _ = cast_at_robot(volume, rays)
        beams = np.flatnonzero(np.minimum.reduceat(distances, starts[:-1]) < clear_ranges).tolist()
        pairs += [(len(parts), beam, int(starts[beam]), int(starts[beam + 1])) for beam in beams]
        if beams:
            parts.append(_lay_out_part(robot, index))
    if not parts:
        return np.zeros(0)
    rows = np.array(parts), np.array(pairs, dtype=np.float64)
    return pack(SteeredSight(*rows, rays, -rays[:, :3], steered.faces))


def _lay_out_part(robot: Robot, index: int) -> Array:
    steered = robot.occluders.steered
    joint, pivot = robot.occluders.steering_of(int(steered.numbers[index]))
    head = [joint, *pivot, narrowing_of(robot.drive, joint)]
    flags = [steered.inside[index], steered.rolls[index]]
    return np.array([*head, *flags, *relative_row(steered.rows[index], pivot)])


def narrowing_of(drive: Drive, joint: int) -> float:
    """Return k in cot(joint) = cot(steering) - k: half the track over the wheelbase, or 0."""
    angles, _ = drive.targets(0.0, drive.steering_limit)
    return 1.0 / elementary.tan(drive.steering_limit) - 1.0 / elementary.tan(angles[joint])


class SteeredParts:
    """Shortens the ranges of beams that hit steered parts of the robot, for rigid-body engines."""

    def __init__(self, robot: Robot) -> None:
        self._sight = lay_out_steered_sight(robot, measure_clear_ranges(robot))
        self.exist = len(self._sight) > 0
        self._see = compile_rule(see_parts, NOTHING(A1, A1, A1)) if self.exist else None

    def lower(self, angles: Array, ranges: Array) -> None:
        """Shorten the range [m] of each beam that hits a part, with joints at ``angles`` [rad]."""
        if self._see is not None:
            self._see(self._sight, angles, ranges)


@compilable
def see_parts_at(sight: Array, steering: float, ranges: Array) -> None:
    """Shorten the range [m] of each beam that hits a part at a bicycle model's ``steering``."""
    parts = unpack(SteeredSight, sight).parts
    tangent = elementary.tan(steering)
    for index in range(len(parts)):
        ahead = 1.0 - parts[index, NARROWING] * tangent
        length = math.sqrt(ahead * ahead + tangent * tangent)
        see_part(sight, index, ahead / length, tangent / length, ranges)


def see_parts(sight: Array, angles: Array, ranges: Array) -> None:
    """Shorten the range [m] of each beam that hits a part, at joint ``angles`` [rad]."""
    parts = unpack(SteeredSight, sight).parts
    for index in range(len(parts)):
        sin, cos = elementary.sin_cos(angles[int(parts[index, JOINT])])
        see_part(sight, index, cos, sin, ranges)


@compilable
def see_part(sight: Array, index: int, cos: float, sin: float, ranges: Array) -> None:
    """Shorten the range [m] of each beam that hits a part rotated by an angle."""
    parts, pairs, rays, backward, faces = unpack(SteeredSight, sight)
    part = parts[index]
    row = part[SHAPE:]
    # The rays are rotated back instead of rotating the part.
    frame = turn_frame(row, cos, -sin)
    x = part[PIVOT] + cos * row[AT_X] - sin * row[AT_Y]
    y = part[PIVOT + 1] + sin * row[AT_X] + cos * row[AT_Y]
    for pair in range(len(pairs)):
        if int(pairs[pair, PART]) != index:
            continue
        beam = int(pairs[pair, BEAM])
        for i in range(int(pairs[pair, FIRST_RAY]), int(pairs[pair, END_RAY])):
            origin = (rays[i, ORIGIN] - x, rays[i, ORIGIN + 1] - y, rays[i, ORIGIN + 2] - row[AT_Z])
            distance = meet_shape(
                row, faces, frame, origin, rays, i, backward, part[INSIDE], part[ROLLS] > 0.0
            )
            if distance < ranges[beam]:
                ranges[beam] = distance
