"""Sensor housings: boxes that must not overlap."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from evoros.base import arrays
from evoros.base.arrays import Array
from evoros.robot.model import Robot

_PARALLEL = 1e-9
_TOUCH_M = 1e-6  # overlap [m] up to which housings count as only touching


@dataclass(frozen=True)
class Housing:
    """The box of a mounted sensor, in the robot's frame."""

    name: str  # name of the sensor's link
    position_m: Sequence[float]  # (3,), its centre
    axes: Array  # (3, 3), one axis per row
    size_m: Sequence[float]  # (3,) [m], along the axes


class Overlap(NamedTuple):
    """Two housings that overlap."""

    depth_m: float  # distance [m] by which one housing must move to clear the other
    first: str
    second: str


def list_housings(robot: Robot) -> list[Housing]:
    """Return the housings of a robot's sensors."""
    return [
        Housing(name, frame[:3, 3].tolist(), frame[:3, :3].T, robot.sensors[mount.sensor].size_m)
        for (name, mount), frame in zip(robot.named_mounts(), robot.sensor_frames, strict=True)
    ]


def find_overlaps(housings: Sequence[Housing]) -> Iterator[Overlap]:
    """Yield each pair of housings that overlap."""
    for first, second in combinations(housings, 2):
        depth = _measure_overlap(first, second)
        if depth > _TOUCH_M and min(*first.size_m, *second.size_m) > 0.0:
            yield Overlap(depth, first.name, second.name)


def _measure_overlap(first: Housing, second: Housing) -> float:
    """Return the distance [m] by which one box must move to clear the other; 0 or less if clear."""
    gap = np.subtract(second.position_m, first.position_m)
    reach = 0.5 * (arrays.length(np.array(first.size_m)) + arrays.length(np.array(second.size_m)))
    if arrays.length(gap) > reach:
        return 0.0
    edges = (np.cross(a, b) for a, b in product(first.axes, second.axes))
    depths = []
    for direction in (*first.axes, *second.axes, *edges):
        length = arrays.length(direction)
        if length > _PARALLEL:
            reach = _reach(first, direction) + _reach(second, direction)
            depths.append((reach - abs(float((gap * direction).sum()))) / length)
    return min(depths)


def _reach(housing: Housing, direction: Array) -> float:
    """Return half the extent of a box along a direction, times the length of the direction."""
    along = np.abs((housing.axes * direction).sum(axis=1))
    return 0.5 * float((along * np.array(housing.size_m)).sum())
