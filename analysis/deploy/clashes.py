"""Which sensors of a champion cannot all be mounted, because their bodies would overlap."""

from collections.abc import Iterator, Sequence
from itertools import combinations, product

import numpy as np

from evoros.base.arrays import Array
from evoros.geometry.shapes import Pose

from .champion import MountedSensor

_PARALLEL = 1e-9
_TOUCH_M = 1e-6  # bodies that overlap by less touch


def list_clashes(sensors: Sequence[MountedSensor]) -> Iterator[str]:
    """Yield a line for each pair of sensors whose bodies overlap."""
    for one, other in combinations(sensors, 2):
        depth = _overlap(one, other)
        if depth > _TOUCH_M and min(*one.size_m, *other.size_m) > 0.0:
            yield (
                f"the bodies of {one.link} and {other.link} overlap; move one of them by "
                f"{1000 * depth:.1f} mm or more"
            )


def _overlap(one: MountedSensor, other: MountedSensor) -> float:
    """Return how far one box must move to be clear of the other; 0 or less: it is clear.

    Two boxes are apart if they are along a normal of a face, or across an edge of each.
    """
    first, second = _axes(one), _axes(other)
    gap = np.subtract(other.position_m, one.position_m)
    directions = [*first, *second, *(np.cross(a, b) for a, b in product(first, second))]
    depths = []
    for direction in directions:
        length = float(np.linalg.norm(direction))
        if length > _PARALLEL:
            reach = _reach(first, one.size_m, direction) + _reach(second, other.size_m, direction)
            depths.append((reach - abs(float(gap @ direction))) / length)
    return min(depths)


def _axes(sensor: MountedSensor) -> Array:
    """Return the axes (3, 3) of a sensor's body in the robot's frame, a row for each."""
    pitch, yaw = np.radians(-sensor.pitch_deg), np.radians(sensor.yaw_deg)
    axes: Array = Pose.from_rpy((0.0, 0.0, 0.0), 0.0, pitch, yaw).rotation.T
    return axes


def _reach(axes: Array, size: Sequence[float], direction: Array) -> float:
    """Return how far a box reaches from its centre along a direction, times its length."""
    return float(np.abs(axes @ direction) @ np.array(size)) / 2
