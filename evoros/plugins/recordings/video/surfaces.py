"""Surfaces of shapes, as triangles."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from evoros.base.arrays import Array
from evoros.geometry.footprint import height_points
from evoros.geometry.polyhedron import convex_polyhedron
from evoros.geometry.shapes import Shape

MAX_SIDE = 129  # maximum number of rows and columns of a height field; others are subsampled
_SIDES, _RINGS = 32, 16  # number of sides of a cylinder, and of rings of a sphere
AMBIENT, DIFFUSE = 0.62, 0.45  # weights of ambient and directional light

Colour = tuple[float, float, float]  # red, green, blue, each 0 to 1


@dataclass(frozen=True, eq=False)
class Surface:
    """The triangles of a rigid body."""

    corners: Array  # (3 t, 4) homogeneous coordinates [m]
    normals: Array  # (t, 3), of length 1
    colours: Array  # values from 0 to 1
    is_open: bool = False  # whether the surface is visible from both sides

    @classmethod
    def from_triangles(cls, triangles: Array, colours: Array, is_open: bool = False) -> "Surface":
        """Create a surface from triangles (t, 3, 3) [m] and colours (t, 3)."""
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        corners = triangles.reshape(-1, 3)
        return cls(np.hstack([corners, np.ones((len(corners), 1))]), normals, colours, is_open)

    @classmethod
    def from_shapes(cls, shapes: Sequence[Shape], colours: Sequence[Colour]) -> "Surface":
        """Create a surface from shapes in the body frame, with one colour per shape."""
        parts = [triangulate(s) @ s.pose.rotation.T + s.pose.position for s in shapes]
        painted = np.repeat(np.reshape(colours, (-1, 3)), list(map(len, parts)), axis=0)
        return cls.from_triangles(np.concatenate([np.empty((0, 3, 3)), *parts]), painted)

    @property
    def triangles(self) -> Array:
        """The corners (t, 3, 3) [m] of the triangles."""
        return self.corners[:, :3].reshape(-1, 3, 3)

    def face(self, eye: Array, frame: Array) -> "Surface":
        """Flip triangles of an open surface that face away from ``eye`` (3,) [m] in the world."""
        if not self.is_open:
            return self
        place = frame[:3, :3].T @ (eye - frame[:3, 3])
        corners = self.corners.reshape(-1, 3, 4)
        behind = ((place - corners[:, 0, :3]) * self.normals).sum(axis=1) < 0.0
        turned = np.where(behind[:, None, None], corners[:, ::-1], corners).reshape(-1, 4)
        normals = np.where(behind[:, None], -self.normals, self.normals)
        return replace(self, corners=turned, normals=normals)

    def shade(self, rotation: Array, light: Array) -> Array:
        """Return the shaded colours (t, 3); ``light`` (3,) is a unit vector towards the light."""
        facing = np.maximum(self.normals @ (rotation.T @ light), 0.0)
        return self.colours * (AMBIENT + DIFFUSE * facing)[:, None]


def triangulate(shape: Shape) -> Array:
    """Return the triangles (t, 3, 3) [m] of a shape, counter-clockwise as seen from outside."""
    if shape.kind == "plane":
        return np.empty((0, 3, 3))
    if shape.kind == "heightfield":
        return _triangulate_heights(shape)
    solid = convex_polyhedron(tuple(map(tuple, _list_corners(shape).tolist())))
    return np.asarray(solid.corners[solid.triangles])


def _list_corners(shape: Shape) -> Array:
    """Return points (n, 3) [m] whose convex hull is the shape, approximately for round shapes."""
    if shape.kind == "box":
        signs = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
        return np.asarray(signs * shape.size)
    if shape.kind == "cylinder":
        radius, length = shape.size
        return np.vstack([_ring(radius, z) for z in (-length / 2, length / 2)])
    if shape.kind == "sphere":
        (radius,) = shape.size
        polar = np.linspace(0.0, math.pi, _RINGS + 1)
        return np.vstack([_ring(radius * math.sin(a), radius * math.cos(a)) for a in polar])
    return np.array(shape.corners)


def _ring(radius: float, height: float) -> Array:
    turn = 2 * math.pi * np.arange(_SIDES) / _SIDES
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), np.full(_SIDES, height)], axis=1)


def _triangulate_heights(shape: Shape) -> Array:
    points = height_points(shape)
    counts = [(length, min(length, MAX_SIDE)) for length in points.shape[:2]]
    rows, columns = ([round(i * (n - 1) / (m - 1)) for i in range(m)] for n, m in counts)
    points = points[np.ix_(rows, columns)]
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, :-1], points[1:, 1:]
    halves = [np.stack(corners, axis=2).reshape(-1, 3, 3) for corners in ((a, b, d), (a, d, c))]
    return np.concatenate(halves)
