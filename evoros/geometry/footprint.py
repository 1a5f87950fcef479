"""Footprints of solid shapes on the ground, and distances to points."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import compress

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array, product
from evoros.compilation.elementary_arrays import cos_all, sin_all
from evoros.geometry import polyhedron
from evoros.geometry.shapes import Body, Pose, Shape

_ELLIPSE_CORNERS = 64
_EXCESS = 1.2e-3  # 1 / cos(pi / 64) - 1: relative excess of a 64-sided polygon around a circle


@dataclass(frozen=True, eq=False)
class Footprint:
    """All points within ``radius`` of a convex polygon, which may be a segment or a point."""

    vertices: Array  # (k, 2) [m], counter-clockwise
    radius: float = 0.0  # [m]


def project_shape(
    shape: Shape, pose: Pose, low_m: float = -math.inf, high_m: float = math.inf
) -> Footprint:
    """Project a shape other than a plane, at ``pose`` in the world, onto the ground.

    A convex polyhedron is projected only between two heights [m], any other shape as a whole. The
    end discs of a tilted cylinder become polygons that exceed them by at most 0.13 % of the radius.
    """
    if shape.kind in ("convex", "heightfield"):
        return Footprint(convex_hull(_extreme_points(shape, pose, low_m, high_m)[:, :2]))
    centre = np.array(pose.position[:2])
    if shape.kind == "sphere":
        return Footprint(centre[None], shape.size[0])
    if shape.kind == "box":
        corners = product(polyhedron.box_corners(shape), pose.rotation.T)
        return Footprint(convex_hull(corners[:, :2]) + centre)
    radius, length = shape.size
    vertices, radius = _project_cylinder(radius, length, pose.rotation[:, 2])
    return Footprint(vertices + centre, radius)


def _extreme_points(shape: Shape, pose: Pose, low_m: float, high_m: float) -> Array:
    """Return points (n, 3) [m] that span a shape's hull; polyhedra are cut at the two heights."""
    corners = polyhedron.placed_corners(_span(shape), pose.rotation, pose.position)
    heights = corners[:, 2]
    if shape.kind == "heightfield" or (low_m <= heights.min() and heights.max() <= high_m):
        return corners
    solid = polyhedron.convex_polyhedron(shape.corners)
    corners = polyhedron.placed_corners(solid.corners, pose.rotation, pose.position)
    return polyhedron.clip_polyhedron(corners, solid.edges, low_m, high_m)


def _span(shape: Shape) -> Array:
    """Return points (n, 3) [m] that span the hull of a polyhedron or height field, in its frame."""
    return height_points(shape).reshape(-1, 3) if shape.kind == "heightfield" else shape.points


def height_points(shape: Shape) -> Array:
    """Return the grid points (rows, columns, 3) [m] of a height field in its frame."""
    heights = np.array(shape.heights, dtype=np.float64)
    rows, columns = heights.shape
    length_x, length_y = shape.size
    x, y = np.meshgrid(
        np.linspace(-length_x / 2, length_x / 2, columns),
        np.linspace(-length_y / 2, length_y / 2, rows),
    )
    return np.stack([x, y, heights], axis=-1)


def _project_cylinder(radius: float, length: float, axis: Array) -> tuple[Array, float]:
    """Return the vertices [m], relative to the centre, and the radius [m] of the footprint."""
    reach = length / 2 * axis[:2]
    if abs(axis[2]) > 1 - _EXCESS:  # the ends project to nearly circular ellipses
        return convex_hull(np.array([reach, -reach])), radius
    along = axis[:2] / math.hypot(axis[0], axis[1])
    across = np.array([-along[1], along[0]])
    disc = product(_circumscribe(radius * abs(float(axis[2])), radius), np.array([along, across]))
    return convex_hull(np.concatenate([disc + reach, disc - reach])), 0.0


def _circumscribe(along: float, across: float) -> Array:
    """Return the corners of a polygon around an ellipse with the given half axes [m]."""
    if along < _EXCESS * across:
        return np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (along, across)
    angles = np.arange(_ELLIPSE_CORNERS) * (2 * math.pi / _ELLIPSE_CORNERS)
    grow = 1 / elementary.cos(math.pi / _ELLIPSE_CORNERS)
    return grow * np.stack([along * cos_all(angles), across * sin_all(angles)], axis=1)


def bottom_height(shape: Shape, pose: Pose) -> float:
    """Return the height [m] of the lowest point of a shape other than a plane, at ``pose``."""
    return find_heights(shape, pose)[0]


def top_height(shape: Shape, pose: Pose) -> float:
    """Return the height [m] of the highest point of a shape other than a plane, at ``pose``."""
    return find_heights(shape, pose)[1]


def lowest_point(body: Body) -> float:
    """Return the height [m] of the lowest point of a body."""
    return min(bottom_height(*solid) for solid in body.placed)


def find_heights(shape: Shape, pose: Pose) -> tuple[float, float]:
    """Return the heights [m] of the lowest and highest point of a shape other than a plane."""
    up = pose.rotation[2]  # the world's z axis in the shape's frame
    if shape.kind in ("convex", "heightfield"):
        heights = product(_span(shape), up) + pose.position[2]
        return float(heights.min()), float(heights.max())
    if shape.kind == "sphere":
        depth = shape.size[0]
    elif shape.kind == "box":
        depth = float(product(np.abs(up), np.array(shape.size))) / 2
    else:
        radius, length = shape.size
        depth = radius * math.hypot(up[0], up[1]) + length / 2 * abs(float(up[2]))
    bottom = pose.position[2] - depth
    return bottom, 2.0 * pose.position[2] - bottom  # the shape is symmetric about its centre


def project_bodies(
    bodies: Iterable[Body], below_m: float = math.inf, around: Array | None = None
) -> tuple[Footprint, ...]:
    """Project all shapes but planes up to the height ``below_m`` [m], where polyhedra are cut.

    Shapes outside the bounding box of the points ``around`` (n, 2) [m] may be left out.
    """
    ends = ((-math.inf,) * 2, (math.inf,) * 2)
    (x0, y0), (x1, y1) = ends if around is None else (around.min(axis=0), around.max(axis=0))
    areas = []
    for body in bodies:
        for shape, pose in compress(body.placed, body.reach((x0, y0, 0.0), (x1, y1, below_m))):
            if shape.kind != "plane":
                bottom, top = find_heights(shape, pose)
                if bottom < below_m and top > 0.0:
                    areas.append(project_shape(shape, pose, 0.0, below_m))
    return tuple(areas)


def bounding_circle(footprint: Footprint) -> tuple[float, float, float]:
    """Return the centre x, y and the radius [m] of a circle that encloses a footprint."""
    x, y = ((footprint.vertices.min(axis=0) + footprint.vertices.max(axis=0)) / 2).tolist()
    reach = np.sqrt(((footprint.vertices - (x, y)) ** 2).sum(axis=1)).max()
    return x, y, float(reach) + footprint.radius


def find_bounds(*footprints: Footprint) -> tuple[Array, Array]:
    """Return the minimum and maximum x, y (2,) [m] of footprints."""
    low = np.min([shape.vertices.min(axis=0) - shape.radius for shape in footprints], axis=0)
    high = np.max([shape.vertices.max(axis=0) + shape.radius for shape in footprints], axis=0)
    return low, high


def convex_hull(points: Array) -> Array:
    """Return the corners of the convex hull of points (n, 2), counter-clockwise.

    Collinear points yield two corners, and coincident points (within 1e-12 of the extent) yield
    one. Andrew's monotone chain is used, because Qhull rejects collinear points.
    """
    extent = float(np.ptp(points, axis=0).max())
    if extent < 1e-100:
        return points[:1].copy()
    # Rounding to an integer grid merges points that differ by rounding; every turn is exact.
    grid = np.rint((points - points.min(axis=0)) * (1e12 / extent)).astype(np.int64).tolist()
    corners = {(x, y): point for (x, y), point in zip(grid, points, strict=True)}
    ordered = sorted(corners)
    hull: list[tuple[int, int]] = []
    for sequence in (ordered, ordered[::-1]):
        chain: list[tuple[int, int]] = []
        for cell in sequence:
            while len(chain) > 1 and not _turns_left(chain[-2], chain[-1], cell):
                chain.pop()
            chain.append(cell)
        hull += chain[:-1]
    # Rounding may put nearly equal points into neighbouring cells.
    return np.array([
        corners[b]
        for a, b in zip(hull[-1:] + hull[:-1], hull, strict=True)
        if len(hull) < 3 or abs(a[0] - b[0]) > 1 or abs(a[1] - b[1]) > 1
    ])  # fmt: skip


def _turns_left(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> bool:
    return (b[0] - a[0]) * (c[1] - a[1]) > (b[1] - a[1]) * (c[0] - a[0])


def contains(footprint: Footprint, point: Sequence[float]) -> bool:
    """Return True if a point (x, y) [m] lies in or on the border of a footprint."""
    low, high = find_bounds(footprint)
    if (low > point).any() or (high < point).any():
        return False
    points = np.array([[point[0], point[1]]], dtype=np.float64)
    return bool(_polygon_distances(footprint.vertices, points)[0] <= footprint.radius)


def distances(footprint: Footprint, points: Array) -> Array:
    """Return the distance (n,) [m] from each of the points (n, 2) [m] to a footprint; 0 inside."""
    return np.maximum(_polygon_distances(footprint.vertices, points) - footprint.radius, 0.0)


def _polygon_distances(polygon: Array, points: Array) -> Array:
    edges = np.roll(polygon, -1, axis=0) - polygon
    squared = np.full(len(points), np.inf)
    inside = np.full(len(points), len(polygon) > 2)
    for (x, y), (dx, dy) in zip(polygon, edges, strict=True):
        px, py = points[:, 0] - x, points[:, 1] - y
        length = dx * dx + dy * dy
        along = np.clip((px * dx + py * dy) / length, 0.0, 1.0) if length > 0 else 0.0
        squared = np.minimum(squared, (px - along * dx) ** 2 + (py - along * dy) ** 2)
        inside &= dx * py - dy * px >= 0
    return np.where(inside, 0.0, np.sqrt(squared))


# A row of FOOTPRINT_SIZE values describes a footprint; a separate array holds all corners.
CENTRE_X, CENTRE_Y, CIRCLE, RADIUS, START, END = range(6)
"""Columns: bounding circle's centre and radius, footprint radius [m], range of corner indices."""
FOOTPRINT_SIZE = 6


@dataclass(frozen=True, eq=False)
class Outlines:
    """Footprints of obstacles as arrays."""

    rows: Array  # (n, FOOTPRINT_SIZE)
    corners: Array  # (k, 2) [m], vertices of all footprints, concatenated

    @classmethod
    def of(cls, footprints: Sequence[Footprint]) -> "Outlines":
        """Pack footprints into arrays."""
        rows, start = np.empty((len(footprints), FOOTPRINT_SIZE)), 0
        for row, footprint in zip(rows, footprints, strict=True):
            end = start + len(footprint.vertices)
            row[:] = *bounding_circle(footprint), footprint.radius, start, end
            start = end
        corners = [footprint.vertices for footprint in footprints]
        return cls(rows, np.concatenate(corners) if corners else np.zeros((0, 2)))
