"""Convex polyhedra: the faces, edges, volume and moments of a convex hull."""

import itertools
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.linear import determinant, product
from evoros.geometry.shapes import Shape, Vector

_SAME_FACE = 9
"""Number of decimals to which the planes of two triangles on one face agree."""


class Polyhedron(NamedTuple):
    """The convex hull of points; all arrays are read-only by convention."""

    corners: Array  # (k, 3) [m], only those on the hull
    triangles: NDArray[np.intp]  # (t, 3) corners, counter-clockwise as seen from outside
    edges: NDArray[np.intp]  # (e, 2) corners, including edges between two triangles of one face
    faces: Array  # (f, 4): a point p is inside if faces[:, :3] @ p <= faces[:, 3] [m]


@lru_cache(maxsize=4096)
def convex_polyhedron(corners: tuple[Vector, ...]) -> Polyhedron:
    """Return the convex hull of points [m] that do not lie in a common plane."""
    points = np.array(corners, dtype=np.float64)
    hull = _hull(points)
    numbers = np.full(len(points), -1)
    numbers[hull.vertices] = np.arange(len(hull.vertices))
    triangles = numbers[_face_outwards(points, hull.simplices, hull.equations)]
    sides = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, ::2]]))
    faces = _distinct_planes(hull.equations)
    return Polyhedron(points[hull.vertices], triangles, np.unique(sides, axis=0), faces)


def hull_planes(points: Array) -> tuple[Array, Array]:
    """Return the hull of points (n, 3) [m]: faces as in ``Polyhedron``, and corners (k, 3)."""
    hull = _hull(points)
    return _distinct_planes(hull.equations), points[hull.vertices]


def _hull(points: Array) -> Any:
    from scipy.spatial import ConvexHull, QhullError  # importing takes longer than most worlds

    try:
        return ConvexHull(points)
    except QhullError:  # nearly flat: let Qhull move the points by a rounding error
        return ConvexHull(points, qhull_options="QJ Pp")


def _distinct_planes(equations: Array) -> Array:
    planes = np.unique(np.round(equations, _SAME_FACE), axis=0, return_index=True)[1]
    faces: Array = equations[np.sort(planes)] * (1.0, 1.0, 1.0, -1.0)
    return faces


def _face_outwards(
    points: Array, triangles: NDArray[np.intp], equations: Array
) -> NDArray[np.intp]:
    """Return triangles with their corners counter-clockwise as seen from outside."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    inwards = (np.cross(b - a, c - a) * equations[:, :3]).sum(axis=1) < 0.0
    turned = triangles.copy()
    turned[inwards] = turned[inwards][:, ::-1]
    return turned


def box_corners(box: Shape) -> Array:
    """Return the corners (8, 3) [m] of a box in its frame."""
    corners: Array = np.array(list(itertools.product((-1, 1), repeat=3))) * np.array(box.size) / 2
    return corners


def clip_polyhedron(corners: Array, edges: NDArray[np.intp], low: float, high: float) -> Array:
    """Return points (n, 3) that span the part of a convex polyhedron between two heights [m].

    ``corners`` (k, 3) [m] are in a frame with a vertical z axis.
    """
    kept = [corners[(corners[:, 2] >= low) & (corners[:, 2] <= high)]]
    first, second = corners[edges[:, 0]], corners[edges[:, 1]]
    for height in (low, high):
        crosses = (first[:, 2] - height) * (second[:, 2] - height) < 0.0
        start, end = first[crosses], second[crosses]
        share = (height - start[:, 2:]) / (end[:, 2:] - start[:, 2:])
        kept.append(start + share * (end - start))
    return np.concatenate(kept)


def solid_properties(corners: tuple[Vector, ...]) -> tuple[float, Array, Array]:
    """Return the mass properties of the hull of corners as a homogeneous solid of density 1.

    Returns:
        The volume [m3], the centre of mass (3,) [m], and the inertia tensor (3, 3) [m5] about it.
    """
    solid = convex_polyhedron(corners)
    inside = solid.corners.mean(axis=0)
    tetrahedra = solid.corners[solid.triangles] - inside  # ``inside`` is each one's fourth corner
    volumes = determinant(tetrahedra) / 6.0
    volume = float(volumes.sum())
    centre = product(volumes, tetrahedra.sum(axis=1)) / 4.0 / volume
    # The integral of x xT over a tetrahedron with a corner at the origin and corner sum s
    sums = tetrahedra.sum(axis=1)
    places = np.concatenate([tetrahedra, sums[:, None]], axis=1)
    squares = (places[..., None] * places[..., None, :]).sum(axis=1)
    products = (volumes[:, None, None] * squares).sum(axis=0)
    second = products / 20.0 - volume * np.outer(centre, centre)
    return volume, inside + centre, np.trace(second) * np.eye(3) - second


def placed_corners(
    corners: Sequence[Vector] | Array, rotation: Array, position: Sequence[float]
) -> Array:
    """Return corners (k, 3) [m] in the frame in which ``rotation`` and ``position`` are given."""
    placed: Array = product(np.asarray(corners, dtype=np.float64), rotation.T) + np.asarray(
        position
    )
    return placed
