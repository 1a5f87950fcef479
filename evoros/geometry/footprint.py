"""Footprints of solid shapes on the ground, and the distances between them."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from evoros.base.arrays import Array
from evoros.geometry.shapes import Body, Pose, Shape

_ELLIPSE_CORNERS = 64
_ROUND = 1.2e-3  # 1 / cos(pi / 64) - 1: by how much 64 corners reach too far


@dataclass(frozen=True, eq=False)
class Footprint:
    """All points within ``radius`` of a convex polygon, which may be a segment or a point."""

    vertices: Array  # (k, 2) [m], counter-clockwise
    radius: float = 0.0  # [m]


def footprint(shape: Shape, pose: Pose) -> Footprint:
    """The projection of a box, cylinder or sphere at ``pose`` (in the world) onto the ground.

    Exact, but for a cylinder that neither stands nor lies: its projected discs are ellipses,
    which are circumscribed, so that it reaches farther by at most 0.13 % of its radius.
    """
    center = np.array(pose.position[:2])
    if shape.kind == "sphere":
        return Footprint(center[None], shape.size[0])
    if shape.kind == "box":
        signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
        corners = signs * np.array(shape.size) / 2 @ pose.rotation.T
        return Footprint(convex_hull(corners[:, :2]) + center)
    radius, length = shape.size
    axis = pose.rotation[:, 2]
    reach = length / 2 * axis[:2]
    if abs(axis[2]) > 1 - _ROUND:  # the ellipses are nearly circles
        return Footprint(convex_hull(np.array([reach, -reach])) + center, radius)
    along = axis[:2] / math.hypot(axis[0], axis[1])
    across = np.array([-along[1], along[0]])
    disc = _ellipse(radius * abs(float(axis[2])), radius) @ np.array([along, across])
    ends = np.concatenate([disc + reach, disc - reach])
    return Footprint(convex_hull(ends) + center)


def _ellipse(along: float, across: float) -> Array:
    """Corners of a polygon around the ellipse of these half axes: four if it is very narrow."""
    if along < _ROUND * across:
        return np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (along, across)
    angles = np.arange(_ELLIPSE_CORNERS) * (2 * math.pi / _ELLIPSE_CORNERS)
    grow = 1 / math.cos(math.pi / _ELLIPSE_CORNERS)
    return grow * np.stack([along * np.cos(angles), across * np.sin(angles)], axis=1)


def lowest(shape: Shape, pose: Pose) -> float:
    """Height [m] of the lowest point of a box, cylinder or sphere at ``pose`` (in the world)."""
    up = pose.rotation[2]  # the world's z axis in the frame of the shape
    if shape.kind == "sphere":
        depth = shape.size[0]
    elif shape.kind == "box":
        depth = float(np.abs(up) @ shape.size) / 2
    else:
        radius, length = shape.size
        depth = radius * math.hypot(up[0], up[1]) + length / 2 * abs(float(up[2]))
    return pose.position[2] - depth


def footprints(bodies: Iterable[Body], below_m: float = math.inf) -> tuple[Footprint, ...]:
    """One footprint for each solid shape that begins below a height [m] and ends above ground."""
    placed = [(shape, body.pose @ shape.pose) for body in bodies for shape in body.shapes]
    return tuple(
        footprint(shape, pose)
        for shape, pose in placed
        if shape.kind != "plane" and lowest(shape, pose) < below_m and highest(shape, pose) > 0.0
    )


def highest(shape: Shape, pose: Pose) -> float:
    """Height [m] of the highest point: these shapes are symmetric about their centres."""
    return 2.0 * pose.position[2] - lowest(shape, pose)


def convex_hull(points: Array) -> Array:
    """The corners of the hull of points (n, 2), counter-clockwise.

    Two corners where the points lie in a line, one if they coincide, as do points that are
    nearer to each other than 1e-12 of the extent. Andrew's monotone chain.
    """
    extent = float(np.ptp(points, axis=0).max())
    if extent < 1e-100:
        return points[:1].copy()
    # On a grid, in whole numbers: points that differ by rounding fall together, and no turn is
    # misjudged.
    grid = np.rint((points - points.min(axis=0)) * (1e12 / extent)).astype(np.int64).tolist()
    corner = {(x, y): point for (x, y), point in zip(grid, points, strict=True)}
    ordered = sorted(corner)
    hull: list[tuple[int, int]] = []
    for sequence in (ordered, ordered[::-1]):
        chain: list[tuple[int, int]] = []
        for place in sequence:
            while len(chain) > 1 and not _turns_left(chain[-2], chain[-1], place):
                chain.pop()
            chain.append(place)
        hull += chain[:-1]
    return np.array([corner[place] for place in hull])


def _turns_left(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> bool:
    return (b[0] - a[0]) * (c[1] - a[1]) > (b[1] - a[1]) * (c[0] - a[0])


def contains(area: Footprint, point: Sequence[float]) -> bool:
    """Whether a point [x, y] lies in a footprint or on its border."""
    here = np.array([[point[0], point[1]]], dtype=np.float64)
    return bool(_distances(area.vertices, here)[0] <= area.radius)


def distances(area: Footprint, points: Array) -> Array:
    """Distance (n,) [m] of points (n, 2) from a footprint; 0 inside."""
    return np.maximum(_distances(area.vertices, points) - area.radius, 0.0)


def _distances(polygon: Array, points: Array) -> Array:
    """(n,): distance of points (n, 2) from a convex polygon (k, 2), 0 inside."""
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
