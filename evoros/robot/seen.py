"""The bearings that the sensors of a robot see."""

import math

import numpy as np
from numpy.typing import NDArray

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.compilation.elementary_arrays import atan2_all, cos_all, sin_all
from evoros.robot.model import Robot
from evoros.sensor.protocol import RAY_DEG, RangeSensor, sees

COUNT = 360
BEARINGS_DEG: Array = np.arange(COUNT, dtype=np.float64) - (COUNT - 1) / 2
"""Left positive, 0 ahead: the middles of the degrees from -180 to 180."""
_EDGE = 1e-9  # [rad] by which a beam includes its edges

Mask = NDArray[np.bool_]


def find_seen(robot: Robot, distance_m: float) -> Mask:
    """Return (sensors, 360) which of the points at ``BEARINGS_DEG`` each range sensor sees.

    The points lie on a circle about the middle of the robot's outline, with ``distance_m`` [m] as
    radius. A sensor sees those within its ranges and between its outermost rays, from above; the
    robot hides none of them. A beam narrower than ``RAY_DEG``, such as a single ray, also sees the
    point of the degree in which its middle meets the circle. A sensor that casts no rays sees
    nothing.
    """
    middle = (robot.outline.min(axis=0) + robot.outline.max(axis=0)) / 2
    points, borders = (distance_m * directions + middle for directions in (_DIRECTIONS, _BORDERS))
    seen = np.zeros((len(robot.mounts), COUNT), dtype=bool)
    poses = robot.sensor_poses
    for place, sensor in enumerate(robot.mounted_sensors()):
        if sees(sensor):
            x, y, _, yaw, _ = poses[place].tolist()
            seen[place] = _find_inside(sensor, points - (x, y), borders - (x, y), yaw)
    return seen


def choose_sector(bearing_deg: float, width_deg: float, both_sides: bool) -> Mask:
    """Return (360,) which bearings lie in a sector about one, or in its mirror image."""
    chosen: Mask = np.zeros(COUNT, dtype=bool)
    for middle in (bearing_deg, -bearing_deg) if both_sides else (bearing_deg,):
        off = np.abs((BEARINGS_DEG - middle + 180.0) % 360.0 - 180.0)
        chosen |= off <= width_deg / 2
    return chosen


def _find_inside(sensor: RangeSensor, points: Array, borders: Array, yaw: float) -> Mask:
    """Return which points are in a sensor's beam.

    ``points`` (n, 2) and ``borders`` (n, 2) are offsets [m] from the sensor; each border precedes
    its point on the circle.
    """
    low, high = _find_edges(sensor)
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
    """Return how far offsets (n, 2) lie ahead and left of a direction."""
    sin, cos = elementary.sin_cos(yaw)
    ahead = cos * offsets[:, 0] + sin * offsets[:, 1]
    return ahead, cos * offsets[:, 1] - sin * offsets[:, 0]


def _find_edges(sensor: RangeSensor) -> tuple[float, float]:
    """Return the outermost azimuths [rad] of the rays; -pi and pi for a sensor all around."""
    rays = sensor.rays()
    azimuths = np.unique(atan2_all(rays[:, 1], rays[:, 0]))
    low, high = float(azimuths[0]), float(azimuths[-1])
    gaps = np.diff(azimuths)
    behind = low + 2 * math.pi - high
    if len(gaps) and behind <= 1.5 * float(gaps.max()) and behind < math.pi / 2:
        return -math.pi, math.pi
    return low, high


def _list_directions(bearings_deg: Array) -> Array:
    angles = np.radians(bearings_deg)
    return np.column_stack((cos_all(angles), sin_all(angles)))


_DIRECTIONS, _BORDERS = _list_directions(BEARINGS_DEG), _list_directions(BEARINGS_DEG - 0.5)
