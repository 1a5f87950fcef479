"""The rays of a robot's sensors, in the frame in which a simulator casts them."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.base.linear import product
from evoros.robot.model import Robot
from evoros.sensor.protocol import RangeSensor, sees


class Beam(NamedTuple):
    """The rays of one channel of a mounted sensor, whose range is the nearest hit of all."""

    origin: Array  # (3,) [m]
    directions: Array  # (k, 3) unit vectors
    range_min: float  # [m]
    range_max: float  # [m]


def sensor_beams(robot: Robot, frames: Iterable[Array]) -> list[Beam]:
    """The beam of each channel of the robot's range sensors, in the order of the true ranges.

    ``frames`` gives, for each mount, the frame (4, 4) of the sensor in the frame of the beams.
    """
    rays = {name: _sort_rays(sensor) for name, sensor in robot.sensors.items() if sees(sensor)}
    beams = []
    for mount, frame in zip(robot.mounts, frames, strict=True):
        sensor = robot.sensors[mount.sensor]
        if not sees(sensor):
            continue
        directions, ends = rays[mount.sensor]
        origin, directions = frame[:3, 3], product(directions, frame[:3, :3].T)
        limits = sensor.range_min_m, sensor.range_max_m
        starts = [0, *ends[:-1]]
        beams += [
            Beam(origin, directions[start:end], *limits)
            for start, end in zip(starts, ends, strict=True)
        ]
    return beams


def _sort_rays(sensor: RangeSensor) -> tuple[Array, list[int]]:
    """Return the rays of a sensor by channel, and the end of each channel's rays.

    Raises:
        InputError: a channel has no ray, or a ray has no channel.
    """
    rays, channels = sensor.rays(), np.asarray(sensor.channel_of())
    counts = np.bincount(channels, minlength=len(sensor.channels)) if len(rays) else np.zeros(1)
    if len(channels) != len(rays) or len(counts) != len(sensor.channels) or not counts.all():
        raise InputError(
            f"{type(sensor).__name__}.channel_of: must name a channel from 0 to "
            f"{len(sensor.channels) - 1} for each of the {len(rays)} rays, and each channel at "
            f"least once; correct it"
        )
    return rays[np.argsort(channels, kind="stable")], np.cumsum(counts).tolist()
