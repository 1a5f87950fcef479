"""The rays of a robot's sensors, in the frame in which a simulator casts them."""

from collections.abc import Iterable
from typing import NamedTuple

from evoros.base.arrays import Array
from evoros.robot.model import Robot


class Beam(NamedTuple):
    """The rays of one mounted sensor."""

    origin: Array  # (3,) [m]
    directions: Array  # (k, 3) unit vectors
    range_min: float  # [m]
    range_max: float  # [m]


def sensor_beams(robot: Robot, frames: Iterable[Array]) -> list[Beam]:
    """The beam of each mount of the robot.

    ``frames`` gives, for each mount, the frame (4, 4) of the sensor in the frame of the beams.
    """
    rays = {name: sensor.rays() for name, sensor in robot.sensors.items()}
    beams = []
    for mount, frame in zip(robot.mounts, frames, strict=True):
        sensor = robot.sensors[mount.sensor]
        directions = rays[mount.sensor] @ frame[:3, :3].T
        beams.append(Beam(frame[:3, 3], directions, sensor.range_min_m, sensor.range_max_m))
    return beams
