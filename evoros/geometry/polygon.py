"""Convex polygons on the ground and how far apart they are. Runs compiled and interpreted alike."""

import math

from evoros.base.arrays import Array
from evoros.base.compilation import compilable


@compilable
def place(outline: Array, x: float, y: float, cos: float, sin: float, placed: Array) -> None:
    """Put the corners ``outline`` (k, 2) of a frame at x, y [m], turned by an angle, in place."""
    for i in range(len(outline)):
        a = outline[i, 0]
        b = outline[i, 1]
        placed[i, 0] = x + cos * a - sin * b
        placed[i, 1] = y + sin * a + cos * b


@compilable
def gap(one: Array, other: Array, enough: float) -> float:
    """Distance [m] between two convex polygons (k, 2), counter-clockwise; 0 where they overlap.

    A polygon may be a segment or a point. Where an edge shows that the distance is more than
    ``enough``, that edge's lower bound is given instead: most pairs are far apart.
    """
    apart = max(_margin(one, other), _margin(other, one))
    if apart > enough or apart <= 0.0:
        return max(apart, 0.0)
    # Of two convex polygons apart, the nearest pair of points has a corner of one of them.
    return math.sqrt(min(_nearest(one, other), _nearest(other, one)))


@compilable
def _margin(polygon: Array, points: Array) -> float:
    """How far the best edge of a polygon keeps all points outside [m]; -inf without an edge."""
    best = -math.inf
    corners = len(polygon)
    for i in range(corners):
        following = i + 1 if i + 1 < corners else 0
        x = polygon[i, 0]
        y = polygon[i, 1]
        dx = polygon[following, 0] - x
        dy = polygon[following, 1] - y
        length = math.sqrt(dx * dx + dy * dy)
        if length == 0.0:
            continue
        least = math.inf
        for j in range(len(points)):
            outside = dy * (points[j, 0] - x) - dx * (points[j, 1] - y)
            if outside < least:
                least = outside
        if least / length > best:
            best = least / length
    return best


@compilable
def _nearest(polygon: Array, points: Array) -> float:
    """Least squared distance [m2] of points (n, 2) from the border of a polygon (k, 2)."""
    best = math.inf
    corners = len(polygon)
    for i in range(corners):
        following = i + 1 if i + 1 < corners else 0
        x = polygon[i, 0]
        y = polygon[i, 1]
        dx = polygon[following, 0] - x
        dy = polygon[following, 1] - y
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
