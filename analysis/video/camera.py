"""Cameras that look at a mission, and where points are in their pictures."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evoros.base.arrays import Array
from evoros.geometry.shapes import Pose

Pixels = NDArray[np.uint8]
Floats = NDArray[np.float32]

NEAR_M = 0.05  # points nearer to the camera are not drawn
BACK_M, UP_M, AHEAD_M = 2.3, 1.9, 0.7  # chase camera: behind and above the robot, looking ahead
CHASE_FOV_DEG, OVERHEAD_FOV_DEG = 50.0, 14.0  # the second is nearly parallel: walls hide little


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera; pixels are counted from the top left."""

    eye: Array  # (3,) [m]
    target: Array  # (3,) [m]
    up: Array  # (3,) upwards in the picture, not along the line of sight
    fov_deg: float  # vertical
    size: tuple[int, int]  # width, height

    @property
    def view(self) -> Array:
        """(4, 4) from the world to the camera, which looks along -z, as in OpenGL."""
        forward = _normalize(self.target - self.eye)
        right = _normalize(np.cross(forward, self.up))
        matrix = np.eye(4)
        matrix[:3, :3] = right, np.cross(right, forward), -forward
        matrix[:3, 3] = -matrix[:3, :3] @ self.eye
        return matrix

    @property
    def pixels_per_radian(self) -> float:
        """The scale in the middle of the picture."""
        return float(self.size[1] / 2.0 / np.tan(np.radians(self.fov_deg) / 2.0))

    @property
    def pixels(self) -> Array:
        """(3, 4) from a point (x, y, z, 1) [m] to (column * depth, row * depth, depth [m])."""
        width, height = self.size
        focus = self.pixels_per_radian
        screen = np.array([[focus, 0, -width / 2], [0, -focus, -height / 2], [0, 0, -1.0]])
        matrix: Array = screen @ self.view[:3]
        return matrix

    @property
    def light(self) -> Array:
        """(3,) of length 1 to a light above the left shoulder: faces of a box differ in shade."""
        right, _, back = self.view[:3, :3]
        return _normalize(np.array([0.0, 0.0, 1.0]) + 0.35 * back - 0.6 * right)

    def plane(self, frame: Array) -> Array:
        """Return (3, 3) from a point (x, y, 1) of the x-y plane of a frame (4, 4) as ``pixels``."""
        matrix: Array = self.pixels @ frame[:, [0, 1, 3]]
        return matrix

    def scale(self, factor: int) -> "Camera":
        """Return the camera with ``factor`` times as many pixels in each direction."""
        width, height = self.size
        return replace(self, size=(width * factor, height * factor))


def chase_camera(x: float, y: float, yaw: float, size: tuple[int, int]) -> Camera:
    """Return the camera behind and above a robot at x, y [m] with heading ``yaw`` [rad]."""
    forward, place = np.array([np.cos(yaw), np.sin(yaw), 0.0]), np.array([x, y, 0.0])
    eye = place - BACK_M * forward + [0.0, 0.0, UP_M]
    up = np.array([0.0, 0.0, 1.0])
    return Camera(eye, place + AHEAD_M * forward, up, CHASE_FOV_DEG, size)


def overhead_camera(low: ArrayLike, high: ArrayLike, size: tuple[int, int]) -> Camera:
    """Return the camera above the rectangle between two corners (2,) [m], with x to the right."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    (width, depth), (x, y) = high - low, (low + high) / 2.0
    shown = max(depth, width * size[1] / size[0])
    height = shown / 2.0 / np.tan(np.radians(OVERHEAD_FOV_DEG) / 2.0)
    eye, target = np.array([x, y, height]), np.array([x, y, 0.0])
    up = np.array([0.0, 1.0, 0.0])
    return Camera(eye, target, up, OVERHEAD_FOV_DEG, size)


def to_matrix(pose: Pose) -> Array:
    """Return a pose as a matrix (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pose.rotation, pose.position
    return matrix


def _normalize(vector: Array) -> Array:
    unit: Array = vector / np.linalg.norm(vector)
    return unit
