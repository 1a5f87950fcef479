"""Surfaces of shapes as triangles."""

import itertools
import math

import numpy as np

from evoros.base.arrays import Array
from evoros.geometry.footprint import height_points
from evoros.geometry.polyhedron import convex_polyhedron
from evoros.geometry.shapes import Shape

MAX_SIDE = 129
"""Height fields with more rows or columns lose every second one, or more."""
_SIDES, _RINGS = 32, 16  # of a cylinder, and of a sphere


def triangulate(shape: Shape) -> Array:
    """Return the triangles (t, 3, 3) [m] of a shape in its frame; a plane has none.

    Their corners follow counter-clockwise as seen from outside, or from above.
    """
    if shape.kind == "plane":
        return np.empty((0, 3, 3))
    if shape.kind == "heightfield":
        return _triangulate_heights(shape)
    solid = convex_polyhedron(tuple(map(tuple, _list_corners(shape).tolist())))
    triangles: Array = solid.corners[solid.triangles]
    return triangles


def _list_corners(shape: Shape) -> Array:
    """Return corners (n, 3) [m] whose hull is a shape, or a round shape nearly."""
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
    rows, columns = (_thin(length) for length in points.shape[:2])
    points = points[np.ix_(rows, columns)]
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, :-1], points[1:, 1:]
    halves = [np.stack(corners, axis=2).reshape(-1, 3, 3) for corners in ((a, b, d), (a, d, c))]
    return np.concatenate(halves)


def _thin(length: int) -> list[int]:
    """Return indices from the first to the last of ``length``, at most ``MAX_SIDE``."""
    count = min(length, MAX_SIDE)
    return [round(i * (length - 1) / (count - 1)) for i in range(count)]
