"""Which bearings the sensors of a robot see."""

import math

import numpy as np
from numpy.typing import NDArray

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.robot.model import Robot
from evoros.sensor.protocol import RangeSensor, sees

COUNT = 360
BEARINGS_DEG: Array = np.arange(COUNT, dtype=np.float64) - (COUNT - 1) / 2
"""Left positive, 0 ahead: the middles of the degrees from -180 to 180."""
_EDGE = 1e-9  # [rad] to which a beam includes its edges

Mask = NDArray[np.bool_]


def find_seen(robot: Robot, distance_m: float) -> Mask:
    """Return (sensors, 360) which of the points at ``BEARINGS_DEG`` each range sensor sees.

    The points lie on a circle about the middle of the robot's outline, with ``distance_m`` [m] as
    radius. A sensor sees those within its ranges and between its outermost rays, from above; the
    robot hides none of them. A sensor that casts no rays sees nothing.
    """
    points = distance_m * _DIRECTIONS + (robot.outline.min(axis=0) + robot.outline.max(axis=0)) / 2
    seen = np.zeros((len(robot.mounts), COUNT), dtype=bool)
    poses = robot.sensor_poses
    for place, sensor in enumerate(robot.mounted_sensors()):
        if sees(sensor):
            x, y, _, yaw, _ = poses[place].tolist()
            seen[place] = _find_inside(sensor, points - (x, y), yaw)
    return seen


def choose_sector(bearing_deg: float, width_deg: float, both_sides: bool) -> Mask:
    """Return (360,) which bearings lie in a sector about one, or in its mirror image."""
    chosen: Mask = _is_near(bearing_deg, width_deg)
    if both_sides:
        chosen |= _is_near(-bearing_deg, width_deg)
    return chosen


def _is_near(bearing_deg: float, width_deg: float) -> Mask:
    off: Array = np.abs((BEARINGS_DEG - bearing_deg + 180.0) % 360.0 - 180.0)
    return np.asarray(off <= width_deg / 2)


def _find_inside(sensor: RangeSensor, offsets: Array, yaw: float) -> Mask:
    """Return which points, by their offsets (n, 2) [m] from the sensor, are in its beam."""
    sin, cos = elementary.sin_cos(yaw)
    ahead = cos * offsets[:, 0] + sin * offsets[:, 1]
    left = cos * offsets[:, 1] - sin * offsets[:, 0]
    far = np.sqrt(ahead * ahead + left * left)
    angles = elementary.atan2_all(left, ahead)
    low, high = _find_edges(sensor)
    inside: Mask = (angles >= low - _EDGE) & (angles <= high + _EDGE)
    return inside & (far >= sensor.range_min_m) & (far <= sensor.range_max_m)


def _find_edges(sensor: RangeSensor) -> tuple[float, float]:
    """Return the outermost azimuths [rad] of the rays; those of a sensor all around have none."""
    rays = sensor.rays()
    azimuths = np.unique(elementary.atan2_all(rays[:, 1], rays[:, 0]))
    low, high = float(azimuths[0]), float(azimuths[-1])
    gaps = np.diff(azimuths)
    behind = low + 2 * math.pi - high
    if len(gaps) and behind <= 1.5 * float(gaps.max()) and behind < math.pi / 2:
        return -math.pi, math.pi
    return low, high


def _list_directions() -> Array:
    angles = np.radians(BEARINGS_DEG)
    return np.column_stack((elementary.cos_all(angles), elementary.sin_all(angles)))


_DIRECTIONS = _list_directions()
