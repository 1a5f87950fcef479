"""Convex polygons on the ground and the distance between two of them."""

import math

from evoros.base.arrays import Array
from evoros.base.compilable import compilable


@compilable
def transform_polygon(
    polygon: Array, x: float, y: float, cos: float, sin: float, result: Array
) -> None:
    """Write the corners ``polygon`` (k, 2) [m], rotated and moved by x, y [m], into ``result``."""
    for i in range(len(polygon)):
        a = polygon[i, 0]
        b = polygon[i, 1]
        result[i, 0] = x + cos * a - sin * b
        result[i, 1] = y + sin * a + cos * b


@compilable
def polygon_distance(first: Array, second: Array, cutoff: float) -> float:
    """Return the distance [m] between convex counter-clockwise polygons (k, 2); 0 if they overlap.

    A polygon may be a segment or a point. Most pairs are far apart, so if an edge proves that the
    distance exceeds ``cutoff``, a lower bound is returned instead.
    """
    apart, _ = find_separation(first, second, cutoff)
    if apart <= cutoff:
        apart = max(apart, find_separation(second, first, cutoff)[0])
    if apart > cutoff or apart <= 0.0:
        return max(apart, 0.0)
    # A corner of one of two disjoint convex polygons belongs to their nearest pair of points.
    return math.sqrt(min(_squared_distance(first, second), _squared_distance(second, first)))


@compilable
def find_edge(polygon: Array, i: int) -> tuple[float, float, float, float]:
    """Return the start x, y [m] and the vector x, y [m] of edge ``i``."""
    following = i + 1 if i + 1 < len(polygon) else 0
    x = polygon[i, 0]
    y = polygon[i, 1]
    return x, y, polygon[following, 0] - x, polygon[following, 1] - y


@compilable
def find_separation(polygon: Array, points: Array, enough: float) -> tuple[float, int]:
    """Return the largest separation [m] of points from an edge of a polygon, and the edge, or -1.

    The search ends at the first edge that separates the points by more than ``enough``.
    """
    best = -math.inf
    edge = -1
    for i in range(len(polygon)):
        x, y, dx, dy = find_edge(polygon, i)
        length = math.sqrt(dx * dx + dy * dy)
        if length == 0.0:
            continue
        nearest = math.inf
        for j in range(len(points)):
            outside = dy * (points[j, 0] - x) - dx * (points[j, 1] - y)
            if outside < nearest:
                nearest = outside
        if nearest / length > best:
            best = nearest / length
            edge = i
        if best > enough:
            break
    return best, edge


@compilable
def _squared_distance(polygon: Array, points: Array) -> float:
    """Return the minimum squared distance [m2] from points (n, 2) to a polygon's border (k, 2)."""
    best = math.inf
    for i in range(len(polygon)):
        x, y, dx, dy = find_edge(polygon, i)
        squared = dx * dx + dy * dy
        for j in range(len(points)):
            px = points[j, 0] - x
            py = points[j, 1] - y
            along = 0.0
            if squared > 0.0:
                along = (px * dx + py * dy) / squared
                along = 0.0 if along < 0.0 else (1.0 if along > 1.0 else along)
            ex = px - along * dx
            ey = py - along * dy
            distance = ex * ex + ey * ey
            if distance < best:
                best = distance
    return best


@compilable
def find_border(polygon: Array, x: float, y: float) -> tuple[float, float, float]:
    """Return the distance [m] from a point to a convex polygon's border, and a unit normal x, y.

    The normal points outwards, and the distance is negative inside.
    """
    best = math.inf
    nearest_x = 0.0
    nearest_y = 0.0
    inside = len(polygon) > 2
    for i in range(len(polygon)):
        start_x, start_y, dx, dy = find_edge(polygon, i)
        px = x - start_x
        py = y - start_y
        squared = dx * dx + dy * dy
        along = 0.0
        if squared > 0.0:
            along = (px * dx + py * dy) / squared
            along = 0.0 if along < 0.0 else (1.0 if along > 1.0 else along)
            inside = inside and dx * py - dy * px >= 0.0
        ex = px - along * dx
        ey = py - along * dy
        distance = ex * ex + ey * ey
        if distance < best:
            best = distance
            nearest_x = ex
            nearest_y = ey
    length = math.sqrt(best)
    if length == 0.0:
        return 0.0, 1.0, 0.0
    sign = -1.0 if inside else 1.0
    return sign * length, sign * nearest_x / length, sign * nearest_y / length
