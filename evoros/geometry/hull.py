"""Convex hulls of points, with few corners and never flat."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from evoros.base.arrays import Array
from evoros.base.linear import principal_axes, product
from evoros.compilation.elementary_arrays import cos_all, sin_all

THICKNESS_M = 0.002  # of a flat hull
SMALLEST_M = 0.001  # extent of a hull that counts
MOST_CORNERS = 96
COARSENESS = 0.005  # distance of a corner left out from the hull, as a share of the extent


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex polyhedron."""

    corners: Array  # (k, 3) [m]
    faces: NDArray[np.integer]  # (m, 3): indices of corners
    planes: Array  # (m, 4): outward normal n and offset c; n . p + c <= 0 inside
    volume: float  # [m3]
    area: float  # [m2]

    def depth(self, points: Array) -> Array:
        """Return how deep [m] in the hull each of the points (k, 3) lies; negative outside."""
        depth = np.full(len(points), np.inf)
        for i in range(0, len(self.planes), 256):
            planes = self.planes[i : i + 256]
            outside = product(points, planes[:, :3].T) + planes[:, 3]
            np.minimum(depth, -outside.max(axis=1), out=depth)
        return depth


def make_hull(points: Array) -> Hull | None:
    """Return the hull of points (k, 3) [m]; None if it is smaller than ``SMALLEST_M``.

    Points in a plane, or nearly so, get ``THICKNESS_M``.
    """
    if len(points) < 3 or float((points.max(axis=0) - points.min(axis=0)).max()) < SMALLEST_M:
        return None
    hull = _qhull(points) if len(points) > 3 else None
    if hull is None or 2 * hull.volume < THICKNESS_M * hull.area:
        points = _thicken(points)
        hull = _qhull(points)
    if hull is None:
        return None
    vertices = np.sort(hull.vertices)
    faces = np.searchsorted(vertices, hull.simplices)
    return Hull(points[vertices], faces, hull.equations, float(hull.volume), float(hull.area))


def hull_volume(points: Array) -> float:
    """Return the volume [m3] of the hull of points (k, 3) [m]; 0 if they are flat."""
    hull = _qhull(points) if len(points) > 3 else None
    return 0.0 if hull is None else float(hull.volume)


def _qhull(points: Array) -> ConvexHull | None:
    try:
        return ConvexHull(points)
    except QhullError:
        return None


def _thicken(points: Array) -> Array:
    """Return the points on both sides of their plane, if they are flat."""
    centre = points.mean(axis=0)
    _, axes = principal_axes(product((points - centre).T, points - centre))
    width = float(np.ptp(product(points - centre, axes[:, 0])))
    if width >= THICKNESS_M:
        return points
    away = axes[:, 0] * (THICKNESS_M - width) / 2
    return np.concatenate([points - away, points + away])


def simplify(hull: Hull) -> tuple[Hull, float]:
    """Return a hull with at most ``MOST_CORNERS`` of the corners, and its largest deviation [m].

    Corners are added, the most distant one first, until the rest lies within ``COARSENESS``.
    """
    if len(hull.corners) <= 500:
        hull = _without_flat_corners(hull)
    corners = hull.corners
    if len(corners) <= 24:
        return hull, 0.0
    tolerance = COARSENESS * float(np.ptp(corners, axis=0).max())
    waiting = corners if len(corners) < 500 else corners[_extremes(corners, _spread(800))]
    chosen = np.union1d(_extremes(waiting, _DIRECTIONS), _extremes(waiting, _spread(40)))
    simple = make_hull(waiting[chosen])
    while simple is not None and len(chosen) < MOST_CORNERS:
        depth = simple.depth(waiting)
        if -float(depth.min()) <= tolerance:
            break
        chosen = np.append(chosen, depth.argmin())
        simple = make_hull(waiting[chosen])
    if simple is None:
        return hull, 0.0
    return simple, max(-float(simple.depth(corners).min()), 0.0)


def _without_flat_corners(hull: Hull) -> Hull:
    """Return the hull without corners in the middle of a face or an edge, which cuts leave."""
    _, first = np.unique(np.round(hull.planes[:, :3], 5), axis=0, return_index=True)
    planes = hull.planes[first]
    touched = np.abs(product(hull.corners, planes[:, :3].T) + planes[:, 3]) < 1e-6
    corners = hull.corners[touched.sum(axis=1) >= 3]
    if len(corners) in (len(hull.corners), 0):
        return hull
    smaller = make_hull(corners)
    same = smaller is not None and abs(smaller.volume - hull.volume) < 1e-6 * hull.volume
    return smaller if smaller is not None and same else hull


def _extremes(points: Array, directions: Array) -> NDArray[np.integer]:
    """Return the indices of the points that are farthest in any of the directions."""
    columns = np.ascontiguousarray(points.T)
    farthest = [
        (product(directions[i : i + 50], columns)).argmax(axis=1)
        for i in range(0, len(directions), 50)
    ]
    return np.unique(np.concatenate(farthest))


@cache
def _spread(count: int) -> Array:
    """Return directions (count, 3), evenly spread over a sphere along a spiral."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (1 + np.sqrt(5)) * np.arange(count)
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * cos_all(angle), radius * sin_all(angle), z], axis=1)


_DIRECTIONS = np.array(
    [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z],
    dtype=np.float64,
)
