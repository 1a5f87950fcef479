"""Convex hulls of points, with a limited number of corners and a minimum thickness."""

import itertools
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError, cKDTree

from evoros.base.arrays import Array, principal_axes, product
from evoros.compilation.elementary_arrays import cos_all, sin_all
from evoros.geometry.triangles import Surface, find_normals, sample

THICKNESS_M = 0.002  # thickness [m] given to a flat hull
SMALLEST_M = 0.001  # minimum extent [m] of a hull
MOST_CORNERS = 96
COARSENESS = 0.005  # maximum distance of an omitted corner from the hull, relative to its extent


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex polyhedron."""

    corners: Array  # (k, 3) [m]
    faces: NDArray[np.integer]  # (m, 3): indices of corners
    planes: Array  # (m, 4): outward normal n and offset c; n . p + c <= 0 inside
    volume: float  # [m3]
    area: float  # [m2]

    def depth(self, points: Array) -> Array:
        """Return the depth (k,) [m] of points (k, 3) [m] inside the hull; negative outside."""
        depth = np.full(len(points), np.inf)
        for i in range(0, len(self.planes), 256):
            planes = self.planes[i : i + 256]
            outside = product(points, planes[:, :3].T) + planes[:, 3]
            np.minimum(depth, -outside.max(axis=1), out=depth)
        return depth


def make_hull(points: Array) -> Hull | None:
    """Return the hull of points (k, 3) [m], thickened if flat; None if below ``SMALLEST_M``."""
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


def _qhull(points: Array) -> ConvexHull | None:
    try:
        return ConvexHull(points)
    except QhullError:
        return None


def _thicken(points: Array) -> Array:
    """Duplicate flat points on both sides of their plane; leave other points unchanged."""
    centre = points.mean(axis=0)
    _, axes = principal_axes(product((points - centre).T, points - centre))
    width = float(np.ptp(product(points - centre, axes[:, 0])))
    if width >= THICKNESS_M:
        return points
    away = axes[:, 0] * (THICKNESS_M - width) / 2
    return np.concatenate([points - away, points + away])


def simplify(hull: Hull) -> tuple[Hull, float]:
    """Return a hull of at most ``MOST_CORNERS`` corners, and its maximum deviation [m]."""
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
    """Return the hull without the corners that cuts leave inside faces or edges."""
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
    columns = np.ascontiguousarray(points.T)
    parts = (directions[i : i + 50] for i in range(0, len(directions), 50))
    return np.unique(np.concatenate([product(part, columns).argmax(axis=1) for part in parts]))


@cache
def _spread(count: int) -> Array:
    """Return directions (count, 3) spread evenly over a sphere, on a spiral."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (1 + np.sqrt(5)) * np.arange(count)
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * cos_all(angle), radius * sin_all(angle), z], axis=1)


_DIRECTIONS = np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
_MANY = 5000  # number of faces above which only every second, third, ... face is sampled


def find_gap(surface: Surface, hull: Hull | None = None) -> float:
    """Return the maximum width [m] of a concave region, such as a room, that the hull spans."""
    hull = hull or make_hull(surface.points)
    if hull is None:
        return 0.0
    extent = float(np.ptp(surface.points, axis=0).max())
    # The step resolves a door in a wall of any length unless this would take too many points.
    step = min(max(extent / 20, 0.01), 0.25 if extent < 10.0 else 0.4)
    step = max(step, float(np.sqrt((hull.area + surface.area) / 1e5)))
    points, _ = sample(surface.triangles, step / 2)
    bridges, _ = sample(hull.corners[hull.faces], step)
    distances, _ = cKDTree(points).query(bridges)
    return max(float(distances.max()) - 0.4 * step, 0.0)


def find_depth(surface: Surface, hull: Hull) -> float:
    """Return the maximum depth [m] of the surface inside its hull."""
    corners = surface.triangles[:: 1 + len(surface.faces) // _MANY]
    # A valley may end on the hull, so sample its middle as well.
    samples = [corners[:, i] for i in range(3)]
    samples += [(corners[:, i] + corners[:, i - 1]) / 2 for i in range(3)]
    samples.append(corners.mean(axis=1))
    # A simplified hull is slightly smaller and much faster.
    simple = simplify(hull)[0] if len(hull.corners) > MOST_CORNERS else hull
    return max(float(simple.depth(np.concatenate(samples)).max()), 0.0)


def is_hull(surface: Surface, hull: Hull, tolerance: float) -> bool:
    """Return True if the surface matches its hull within a tolerance [m], except at the bottom."""
    if find_depth(surface, hull) > tolerance:
        return False
    lacking = hull.area - surface.area
    if abs(lacking) <= 0.02 * hull.area:
        return find_gap(surface, hull) <= tolerance
    # The area vectors of a closed surface sum to zero; otherwise the sum points into the opening.
    corners = surface.triangles
    normals = find_normals(corners) / 2
    away = (normals * (corners.mean(axis=1) - hull.corners.mean(axis=0))).sum(axis=1)
    opening = -(normals * np.sign(away)[:, None]).sum(axis=0)
    size = float(np.sqrt((opening * opening).sum()))
    return abs(size - lacking) <= 0.02 * hull.area and float(opening[2]) < -0.7 * size
