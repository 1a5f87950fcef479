"""Cameras that look at a mission: where they are, and where what they see is in a picture."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evoros.base.arrays import Array

Pixels = NDArray[np.uint8]
Floats = NDArray[np.float32]

BACK_M, UP_M, AHEAD_M = 2.3, 1.9, 0.7  # of the camera that follows: behind, above, what it looks at
CHASE_FOV_DEG, ABOVE_FOV_DEG = 50.0, 14.0  # the second is nearly parallel: walls hide little


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera; the picture's pixels are counted from its top left."""

    eye: Array  # (3,) [m]
    target: Array  # (3,) [m]
    up: Array  # (3,) upwards in the picture, not along the line of sight
    fov_deg: float  # vertical
    size: tuple[int, int]  # width, height
    near_m: float
    far_m: float

    @property
    def view(self) -> Array:
        """(4, 4): from the world to the camera, which looks along -z; as OpenGL has it."""
        forward = _unit(self.target - self.eye)
        right = _unit(np.cross(forward, self.up))
        matrix = np.eye(4)
        matrix[:3, :3] = right, np.cross(right, forward), -forward
        matrix[:3, 3] = -matrix[:3, :3] @ self.eye
        return matrix

    @property
    def projection(self) -> Array:
        """(4, 4): from the camera to clip coordinates; as OpenGL has it."""
        width, height = self.size
        focus = 1.0 / np.tan(np.radians(self.fov_deg) / 2.0)
        near, far = self.near_m, self.far_m
        matrix = np.zeros((4, 4))
        matrix[0, 0], matrix[1, 1] = focus * height / width, focus
        matrix[2, 2:] = (far + near) / (near - far), 2.0 * far * near / (near - far)
        matrix[3, 2] = -1.0
        return matrix

    @property
    def pixels_per_radian(self) -> float:
        """In the middle of the picture."""
        return float(self.size[1] / 2.0 / np.tan(np.radians(self.fov_deg) / 2.0))

    @property
    def pixels(self) -> Array:
        """(3, 4): a point (x, y, z, 1) [m] becomes (column * depth, row * depth, depth [m])."""
        width, height = self.size
        screen = np.array([[width / 2, 0, width / 2], [0, -height / 2, height / 2], [0, 0, 1.0]])
        found: Array = screen @ (self.projection @ self.view)[[0, 1, 3]]
        return found

    @property
    def light(self) -> Array:
        """(3,): to a light above the left shoulder; so no two faces of a box look the same."""
        right, _, back = self.view[:3, :3]
        found: Array = np.array([0.0, 0.0, 1.0]) + 0.35 * back - 0.6 * right
        return found

    def plane(self, frame: Array) -> Array:
        """(3, 3): a point (x, y, 1) of the x-y plane of a frame (4, 4), as ``pixels``."""
        found: Array = self.pixels @ frame[:, [0, 1, 3]]
        return found

    def depth(self, buffer: Floats) -> Floats:
        """Depth [m] of what a depth buffer has, from 0 (near) to 1 (far)."""
        near, far = self.near_m, self.far_m
        return np.asarray(far * near / (far - (far - near) * buffer), dtype=np.float32)

    def scaled(self, factor: int) -> "Camera":
        """The same with so many times as many pixels in each direction."""
        width, height = self.size
        size = (width * factor, height * factor)
        return Camera(self.eye, self.target, self.up, self.fov_deg, size, self.near_m, self.far_m)


def chase(x: float, y: float, yaw: float, size: tuple[int, int]) -> Camera:
    """Behind and above a robot at x, y [m] that heads for ``yaw`` [rad]."""
    ahead, place = np.array([np.cos(yaw), np.sin(yaw), 0.0]), np.array([x, y, 0.0])
    eye = place - BACK_M * ahead + [0.0, 0.0, UP_M]
    up = np.array([0.0, 0.0, 1.0])
    return Camera(eye, place + AHEAD_M * ahead, up, CHASE_FOV_DEG, size, 0.1, 60.0)


def above(low: ArrayLike, high: ArrayLike, size: tuple[int, int]) -> Camera:
    """Straight above a rectangle (2,), (2,) [m], which fills the picture; x to the right."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    (wide, deep), (x, y) = high - low, (low + high) / 2.0
    tall = max(deep, wide * size[1] / size[0])
    height = tall / 2.0 / np.tan(np.radians(ABOVE_FOV_DEG) / 2.0)
    eye, target = np.array([x, y, height]), np.array([x, y, 0.0])
    up = np.array([0.0, 1.0, 0.0])
    return Camera(eye, target, up, ABOVE_FOV_DEG, size, height / 2.0, height * 1.1)


def _unit(vector: Array) -> Array:
    found: Array = vector / np.linalg.norm(vector)
    return found
