"""The beams of a robot's range sensors and the zones of its contact sensors, in its frame."""

from typing import NamedTuple

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.robot.model import Robot
from evoros.robot.rays import DIRECTION, LIMIT, ORIGIN
from evoros.robot.self_sight import measure_clear_ranges
from evoros.sensor.protocol import feels, sees


class Beam(NamedTuple):
    """The rays of one channel of a mounted sensor; its range is the nearest hit."""

    origin: Array  # (3,) [m]
    directions: Array  # (k, 3) unit vectors
    range_min: float  # [m]
    range_max: float  # [m]
    clear_range: float  # [m] without obstacles: range_max, or the distance to a part of the robot


def sensor_beams(robot: Robot) -> list[Beam]:
    """Return the beam of each channel of the range sensors, in the order of the true ranges."""
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
    """The zone of a mounted contact sensor from above, in the robot's frame."""

    x: float  # [m], position of the mount
    y: float
    cos: float  # direction in which the sensor faces
    sin: float
    depth: float  # [m]
    width: float  # [m]


ZONE_SIZE = len(Zone._fields)


def find_zones(robot: Robot) -> dict[int, Zone]:
    """Return the zones of a robot by mount index."""
    zones, frames = {}, robot.sensor_frames
    for index, sensor in enumerate(robot.mounted_sensors()):
        if feels(sensor):
            x, y, across = float(frames[index, 0, 3]), float(frames[index, 1, 3]), frames[index]
            # The left axis stays level under a pitch.
            cos, sin = float(across[1, 1]), -float(across[0, 1])
            zones[index] = Zone(x, y, cos, sin, float(sensor.depth_m), float(sensor.width_m))
    return zones


@compilable
def crosses_zone(zone: Zone, ax: float, ay: float, bx: float, by: float) -> bool:
    """Return True if the segment from a to b, in the robot's frame [m], meets a zone."""
    x, y, cos, sin, depth, width = zone
    start = 0.0
    end = 1.0
    ahead = cos * (ax - x) + sin * (ay - y) + depth
    aside = cos * (ay - y) - sin * (ax - x)
    forward = cos * (bx - ax) + sin * (by - ay)
    leftward = cos * (by - ay) - sin * (bx - ax)
    half = 0.5 * width
    for side in range(3):
        # Distance of the segment's start inside an edge, and its change along the segment.
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
