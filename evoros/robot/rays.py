"""The rays of a robot's sensors as an array, in the robot's frame."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.sensor.protocol import Mount, RangeSensor

# A ray is a row of RAY_SIZE values.
DIRECTION, ORIGIN, HOUSING, LIMIT = 0, 3, 6, 7
"""Unit vector (3,); origin (3,) [m]; exit from the sensor's housing [m]; sensor range [m]."""
RAY_SIZE = 8


class SortedRays(NamedTuple):
    """The rays of a sensor type, sorted by channel."""

    directions: Array  # (k, 3), in the sensor's frame
    ends: list[int]  # one per channel, cumulative


class RayTable(NamedTuple):
    """The rays of all range sensors of a robot, by beam."""

    rows: Array  # (r, RAY_SIZE)
    starts: NDArray[np.int64]  # (n + 1,) first ray of each beam, then the total


def sort_rays(sensor: RangeSensor) -> SortedRays:
    """Return the rays of a sensor, sorted by channel.

    Raises:
        InputError: a channel has no ray, or a ray has no channel.
    """
    rays, channels = sensor.rays(), np.asarray(sensor.channel_of())
    counts = np.bincount(channels, minlength=len(sensor.channels)) if len(rays) else np.zeros(1)
    if len(channels) != len(rays) or len(counts) != len(sensor.channels) or not counts.all():
        raise InputError(
            f"{type(sensor).__name__}.channel_of: must return a channel from 0 to "
            f"{len(sensor.channels) - 1} for each of the {len(rays)} rays, and each channel at "
            f"least once; change the channels or the rays that it returns"
        )
    return SortedRays(rays[np.argsort(channels, kind="stable")], np.cumsum(counts).tolist())


def tabulate_rays(
    mounts: Sequence[Mount],
    frames: Array,
    sensors: Mapping[str, RangeSensor],
    rays: Mapping[str, SortedRays],
) -> RayTable:
    """Return the rays of mounted sensors; ``frames`` (n, 4, 4) are one per mount."""
    tables, counts = [np.zeros((0, RAY_SIZE))], [0]
    for name, (directions, ends) in rays.items():  # mounts of one type are contiguous
        chosen = [index for index, mount in enumerate(mounts) if mount.sensor == name]
        if chosen:
            tables.append(lay_out_rays(sensors[name], directions, frames[chosen]))
            counts += np.diff([0, *ends]).tolist() * len(chosen)
    return RayTable(np.concatenate(tables), np.cumsum(counts))


def lay_out_rays(sensor: RangeSensor, rays: Array, frames: Array) -> Array:
    """Return rows (n * k, RAY_SIZE) of a sensor's ``rays`` (k, 3) at ``frames`` (n, 4, 4)."""
    rows = np.empty((len(frames), len(rays), RAY_SIZE))
    axes = frames[:, None, :3, :3]
    turned = rays[:, :1] * axes[..., 0]
    turned = turned + rays[:, 1:2] * axes[..., 1] + rays[:, 2:] * axes[..., 2]
    rows[..., DIRECTION : DIRECTION + 3] = turned
    rows[..., ORIGIN : ORIGIN + 3] = frames[:, None, :3, 3]
    steep = np.maximum(np.abs(rays), 1e-12)  # no division by 0; such a ray leaves elsewhere
    rows[..., HOUSING] = (0.5 * np.array(sensor.size_m) / steep).min(axis=1)
    rows[..., LIMIT] = sensor.range_max_m
    return rows.reshape(-1, RAY_SIZE)
