"""Surfaces of shapes as triangles, for pictures and files."""

import numpy as np

from evoros.base.arrays import Array
from evoros.geometry.footprint import height_points
from evoros.geometry.polyhedron import convex_polyhedron
from evoros.geometry.shapes import Shape

MAX_SIDE = 129
"""Height fields with more rows or columns lose every second one, or more, in pictures."""


def triangulate(shape: Shape) -> Array:
    """Return the triangles (t, 3, 3) [m] of a polyhedron or a height field, in its frame.

    Their corners follow counter-clockwise as seen from outside, or from above.
    """
    if shape.kind == "convex":
        solid = convex_polyhedron(shape.corners)
        triangles: Array = solid.corners[solid.triangles]
        return triangles
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
