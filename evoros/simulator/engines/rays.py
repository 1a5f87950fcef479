"""The rays of a robot's sensors, in the frame in which a simulator casts them."""

from collections.abc import Iterable
from typing import NamedTuple

from evoros.base.arrays import Array
from evoros.base.linear import product
from evoros.robot.model import Robot
from evoros.robot.self_sight import measure_self_ranges, sort_rays
from evoros.sensor.protocol import sees


class Beam(NamedTuple):
    """The rays of one channel of a mounted sensor, whose range is the nearest hit of all."""

    origin: Array  # (3,) [m]
    directions: Array  # (k, 3) unit vectors
    range_min: float  # [m]
    range_max: float  # [m]
    clear_range: float  # [m] without obstacles: range_max, or to a part of the robot itself


def sensor_beams(robot: Robot, frames: Iterable[Array]) -> list[Beam]:
    """The beam of each channel of the robot's range sensors, in the order of the true ranges.

    ``frames`` gives, for each mount, the frame (4, 4) of the sensor in the frame of the beams.
    """
    rays = {name: sort_rays(sensor) for name, sensor in robot.sensors.items() if sees(sensor)}
    beams: list[Beam] = []
    nearest = measure_self_ranges(robot).tolist()
    for mount, frame in zip(robot.mounts, frames, strict=True):
        sensor = robot.sensors[mount.sensor]
        if not sees(sensor):
            continue
        directions, ends = rays[mount.sensor]
        origin, directions = frame[:3, 3], product(directions, frame[:3, :3].T)
        limits = sensor.range_min_m, sensor.range_max_m
        starts = [0, *ends[:-1]]
        for start, end in zip(starts, ends, strict=True):
            clear = min(sensor.range_max_m, nearest[len(beams)])
            beams.append(Beam(origin, directions[start:end], *limits, clear))
    return beams
