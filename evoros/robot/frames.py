"""Where the sensors of a robot are: their poses and frames, from those on its links."""

import math

import numpy as np

from evoros.base.arrays import Array
from evoros.compilation.elementary_arrays import cos_all, sin_all

_RADIAN = math.pi / 180.0  # per degree


def place_on_links(links: Array, poses: Array) -> Array:
    """Return poses (n, 5) in the robot's frame: x, y, z [m], yaw (left), pitch (nose up) [rad].

    ``poses`` (n, 5) [m, deg] are in the frames of ``links`` (n, 4) or (4,): x, y, z [m], yaw [rad].
    """
    x, y, z, yaw = links.T
    sin, cos = sin_all(yaw), cos_all(yaw)
    along, across, up, turn, pitch = poses.T
    placed = (
        x + cos * along - sin * across,
        y + sin * along + cos * across,
        z + up,
        yaw + turn * _RADIAN,
        pitch * _RADIAN,
    )
    return np.ascontiguousarray(np.stack(placed, axis=1))


def make_frames(poses: Array) -> Array:
    """Return the frames (n, 4, 4) [m] of poses (n, 5) [m, rad]; x is along the beam."""
    x, y, z, yaw, pitch = poses.T
    sy, cy, sp, cp = sin_all(yaw), cos_all(yaw), sin_all(pitch), cos_all(pitch)
    none, one = np.zeros(len(poses)), np.ones(len(poses))
    rows = (
        (cy * cp, -sy, -cy * sp, x),
        (sy * cp, cy, -sy * sp, y),
        (sp, none, cp, z),
        (none, none, none, one),
    )
    return np.ascontiguousarray(np.moveaxis(np.array(rows), 2, 0))
