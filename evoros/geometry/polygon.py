"""Convex polygons on the ground: the distance and the contact between two polygons."""

import math

from evoros.base.arrays import Array
from evoros.base.compilable import compilable


@compilable
def transform_polygon(
    polygon: Array, x: float, y: float, cos: float, sin: float, result: Array
) -> None:
    """Write ``polygon`` (k, 2) [m], rotated and then moved by x, y [m], into ``result``."""
    for i in range(len(polygon)):
        a = polygon[i, 0]
        b = polygon[i, 1]
        result[i, 0] = x + cos * a - sin * b
        result[i, 1] = y + sin * a + cos * b


@compilable
def polygon_distance(first: Array, second: Array, cutoff: float) -> float:
    """Return the distance [m] between convex counter-clockwise polygons (k, 2); 0 if they overlap.

    A polygon may be a segment or a point. A distance above ``cutoff`` may be a lower bound.
    """
    apart, _ = find_separation(first, second, cutoff)
    if apart <= cutoff:
        apart = max(apart, find_separation(second, first, cutoff)[0])
    if apart > cutoff or apart <= 0.0:
        return max(apart, 0.0)
    # The shortest path between two disjoint convex polygons starts or ends at a corner.
    return _nearest(first, second)[0]


@compilable
def find_edge(polygon: Array, i: int) -> tuple[float, float, float, float]:
    """Return the start (x, y) [m] and the direction vector (x, y) [m] of edge ``i``."""
    following = i + 1 if i + 1 < len(polygon) else 0
    x = polygon[i, 0]
    y = polygon[i, 1]
    return x, y, polygon[following, 0] - x, polygon[following, 1] - y


@compilable
def find_separation(polygon: Array, points: Array, enough: float) -> tuple[float, int]:
    """Return the maximum separation [m] of points from a polygon's edge, and the edge (-1: none).

    The search stops at the first edge that separates the points by more than ``enough`` [m].
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
def _off_edge(px: float, py: float, dx: float, dy: float, squared: float) -> tuple[float, float]:
    """Return p minus the nearest point [m] of edge d; p and d are relative to the edge's start."""
    along = 0.0
    if squared > 0.0:
        along = (px * dx + py * dy) / squared
        along = 0.0 if along < 0.0 else (1.0 if along > 1.0 else along)
    return px - along * dx, py - along * dy


@compilable
def find_border(polygon: Array, x: float, y: float) -> tuple[float, float, float]:
    """Return the distance [m] to a convex polygon, negative inside, and the outward normal."""
    best = math.inf
    nearest_x = 0.0
    nearest_y = 0.0
    inside = len(polygon) > 2
    for i in range(len(polygon)):
        start_x, start_y, dx, dy = find_edge(polygon, i)
        px = x - start_x
        py = y - start_y
        squared = dx * dx + dy * dy
        ex, ey = _off_edge(px, py, dx, dy, squared)
        if squared > 0.0:
            inside = inside and dx * py - dy * px >= 0.0
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


EDGE_TOLERANCE_M = 1e-4  # maximum distance of a touching edge's corners behind the foremost one


@compilable
def polygon_contact(
    first: Array, second: Array, first_radius: float, second_radius: float
) -> tuple[float, float, float, float, float, float]:
    """Return the contact of two convex counter-clockwise polygons (k, 2) [m], possibly rounded.

    A polygon may be a segment or a point, and is widened by its radius [m]. The result is the
    overlap depth [m], at most 0 without contact; the unit normal x, y from the first to the second
    polygon; the contact's position along the normal [m]; and the contact's minimum and maximum
    position along the normal's left-hand perpendicular [m].
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
    # The ends of the second edge are measured in the opposite direction.
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
    """Return the distance [m] from a polygon to the nearest of the points, and its direction."""
    best = math.inf
    nx = 0.0
    ny = 0.0
    for i in range(len(polygon)):
        x, y, dx, dy = find_edge(polygon, i)
        squared = dx * dx + dy * dy
        for j in range(len(points)):
            ex, ey = _off_edge(points[j, 0] - x, points[j, 1] - y, dx, dy, squared)
            distance = math.sqrt(ex * ex + ey * ey)
            if distance < best:
                best = distance
                nx = ex / distance if distance > 0.0 else 0.0
                ny = ey / distance if distance > 0.0 else 0.0
    return best, nx, ny


@compilable
def _support(polygon: Array, nx: float, ny: float) -> tuple[float, float, float]:
    """Return the extent [m] of a polygon along a normal, and its touching edge's ends across it."""
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
