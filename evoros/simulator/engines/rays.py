"""The beams of a robot's sensors, in the robot's frame."""

from typing import NamedTuple

from evoros.base.arrays import Array
from evoros.robot.model import Robot
from evoros.robot.rays import DIRECTION, LIMIT, ORIGIN
from evoros.robot.self_sight import measure_clear_ranges
from evoros.sensor.protocol import sees


class Beam(NamedTuple):
    """The rays of one channel of a mounted sensor, whose range is the nearest hit of all."""

    origin: Array  # (3,) [m]
    directions: Array  # (k, 3) unit vectors
    range_min: float  # [m]
    range_max: float  # [m]
    clear_range: float  # [m] without obstacles: range_max, or to a part of the robot itself


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
