"""The contact between two convex polygons on the ground that overlap slightly."""

import math

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.geometry.polygon import find_edge, find_separation

EDGE_TOLERANCE_M = 1e-4
"""Corners within this distance of the farthest reach belong to the touching edge."""


@compilable
def polygon_contact(
    first: Array, second: Array, first_radius: float, second_radius: float
) -> tuple[float, float, float, float, float, float]:
    """Return the contact of two convex counter-clockwise polygons (k, 2) [m], possibly rounded.

    Each polygon may be a segment or a point, and is widened by its radius [m].

    Returns:
        The depth [m] of the overlap, at most 0 without contact; the normal x, y, from the first to
        the second; the position of the contact along the normal [m]; and the lowest and the highest
        position of the contact along the normal's left-hand perpendicular [m].
    """
    radius = first_radius + second_radius
    best, nx, ny = _widest_gap(first, second)
    other, ox, oy = _widest_gap(second, first)
    if other > best:
        best, nx, ny = other, -ox, -oy
    if best >= radius and best > -math.inf:
        return radius - best, nx, ny, 0.0, 0.0, 0.0
    if best > 0.0 or best == -math.inf:
        best, nx, ny = _nearest(first, second)
        if best >= radius or best == 0.0:
            return radius - best if best > 0.0 else 0.0, nx, ny, 0.0, 0.0, 0.0
    near, low, high = _support(first, nx, ny)
    far, from_, to = _support(second, -nx, -ny)
    # The perpendicular of the opposite normal points the other way.
    start = max(low, -to)
    end = min(high, -from_)
    if start > end:
        start = end = 0.5 * (start + end)
    along = 0.5 * (near + first_radius - far - second_radius)
    return radius - best, nx, ny, along, start, end


@compilable
def _widest_gap(polygon: Array, points: Array) -> tuple[float, float, float]:
    """Return the largest gap [m] between a polygon's edge and all points, and the edge's normal."""
    gap, i = find_separation(polygon, points, math.inf)
    if i < 0:
        return gap, 0.0, 0.0
    _, _, dx, dy = find_edge(polygon, i)
    length = math.sqrt(dx * dx + dy * dy)
    return gap, dy / length, -dx / length


@compilable
def _nearest(first: Array, second: Array) -> tuple[float, float, float]:
    """Return the distance [m] between two disjoint polygons, and the shortest path's direction."""
    best, nx, ny = _from_corners(second, first)
    other, ox, oy = _from_corners(first, second)
    if other < best:
        return other, -ox, -oy
    return best, nx, ny


@compilable
def _from_corners(points: Array, polygon: Array) -> tuple[float, float, float]:
    """Return the distance [m] from a polygon to the nearest point, and the direction to it."""
    best = math.inf
    nx = 0.0
    ny = 0.0
    for i in range(len(polygon)):
        x, y, dx, dy = find_edge(polygon, i)
        squared = dx * dx + dy * dy
        for j in range(len(points)):
            px = points[j, 0] - x
            py = points[j, 1] - y
            along = 0.0
            if squared > 0.0:
                along = min(max((px * dx + py * dy) / squared, 0.0), 1.0)
            ex = px - along * dx
            ey = py - along * dy
            distance = math.sqrt(ex * ex + ey * ey)
            if distance < best:
                best = distance
                nx = ex / distance if distance > 0.0 else 0.0
                ny = ey / distance if distance > 0.0 else 0.0
    return best, nx, ny


@compilable
def _support(polygon: Array, nx: float, ny: float) -> tuple[float, float, float]:
    """Return a polygon's reach along a normal [m], and the ends of its touching edge across it."""
    reach = -math.inf
    for i in range(len(polygon)):
        reach = max(reach, polygon[i, 0] * nx + polygon[i, 1] * ny)
    low = math.inf
    high = -math.inf
    for i in range(len(polygon)):
        if polygon[i, 0] * nx + polygon[i, 1] * ny >= reach - EDGE_TOLERANCE_M:
            place = polygon[i, 1] * nx - polygon[i, 0] * ny
            low = min(low, place)
            high = max(high, place)
    return reach, low, high
