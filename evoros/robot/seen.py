"""The bearings at which a robot's sensors see a point."""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.compilation.elementary_arrays import atan2_all, cos_all, sin_all
from evoros.robot.model import Robot
from evoros.sensor.protocol import RAY_DEG, RangeSensor, find_field, sees

COUNT = 360
BEARINGS_DEG: Array = np.arange(COUNT, dtype=np.float64) - (COUNT - 1) / 2
"""The centres of 360 one-degree sectors from -180 to 180 deg, left positive."""
_EDGE = 1e-9  # [rad], tolerance at the edges of a beam
Mask = NDArray[np.bool_]


def find_seen(robot: Robot, distance_m: float) -> Mask:
    """Return a mask (sensors, 360), True at each of ``BEARINGS_DEG`` that a range sensor sees.

    The point at a bearing is ``distance_m`` [m] from the middle of the outline. In top view, a
    sensor sees the points within its ranges and field of view; the robot hides nothing. A beam
    narrower than ``RAY_DEG`` also sees the point with its centre line in the one-degree sector.
    """
    middle = (robot.outline.min(axis=0) + robot.outline.max(axis=0)) / 2
    points, borders = (distance_m * _list_directions(shift) + middle for shift in (0.0, -0.5))
    seen = np.zeros((len(robot.mounts), COUNT), dtype=bool)
    poses = robot.sensor_poses
    for place, sensor in enumerate(robot.mounted_sensors()):
        if sees(sensor):
            x, y, _, yaw, _ = poses[place].tolist()
            seen[place] = _find_inside(sensor, points - (x, y), borders - (x, y), yaw)
    return seen


def choose_sector(bearing_deg: float, width_deg: float, both_sides: bool) -> Mask:
    """Return the mask (360,) of a sector about a bearing; ``both_sides`` adds its mirror image."""
    chosen: Mask = np.zeros(COUNT, dtype=bool)
    for middle in (bearing_deg, -bearing_deg) if both_sides else (bearing_deg,):
        off = np.abs((BEARINGS_DEG - middle + 180.0) % 360.0 - 180.0)
        chosen |= off <= width_deg / 2
    return chosen


def _find_inside(sensor: RangeSensor, points: Array, borders: Array, yaw: float) -> Mask:
    """Return a mask of the points inside a beam, which are relative to the sensor (n, 2) [m]."""
    low, high = find_field(sensor)
    ahead, left = _turn(points, yaw)
    angles = atan2_all(left, ahead)
    inside: Mask = (angles >= low - _EDGE) & (angles <= high + _EDGE)
    if high - low < math.radians(RAY_DEG):
        middle = yaw + (low + high) / 2
        is_left, in_front = _turn(borders, middle)[1] > 0.0, _turn(points, middle)[0] > 0.0
        inside |= (is_left != np.roll(is_left, -1)) & in_front
    far = np.sqrt(ahead * ahead + left * left)
    return inside & (far >= sensor.range_min_m) & (far <= sensor.range_max_m)


def _turn(offsets: Array, yaw: float) -> tuple[Array, Array]:
    """Return the components of offsets (n, 2) along a direction and to its left."""
    sin, cos = elementary.sin_cos(yaw)
    ahead = cos * offsets[:, 0] + sin * offsets[:, 1]
    return ahead, cos * offsets[:, 1] - sin * offsets[:, 0]


@cache
def _list_directions(shift_deg: float) -> Array:
    """Return unit vectors along the shifted bearings; cached, because numba starts slowly."""
    angles = np.radians(BEARINGS_DEG + shift_deg)
    return np.column_stack((cos_all(angles), sin_all(angles)))
