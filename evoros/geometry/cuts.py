"""Cut surfaces of triangles by planes, and close the cuts."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.linear import product
from evoros.geometry.triangles import Indices, Surface


def cut(surface: Surface, normal: Array, offset: float, capped: bool) -> list[Surface]:
    """Return the parts below and above the plane ``normal . p = offset``; capped: closed."""
    distance = product(surface.points, normal) - offset
    distance[np.abs(distance) < 1e-6] = 0.0
    sides = []
    for sign in (1.0, -1.0):
        side, segments, owners = _clip(surface, sign * distance)
        if capped and len(segments):
            side = _cap(side, segments, owners, int(np.argmax(np.abs(normal))))
        if len(side.faces):
            sides.append(side)
    return sides


def _clip(surface: Surface, distance: Array) -> tuple[Surface, Indices, Indices]:
    """Return the part at negative distances, the segments (m, 2) of the cut, and their faces (m,).

    A face in the plane itself belongs to neither side, whose caps take its place.
    """
    faces, d = surface.faces, distance[surface.faces]
    inside, outside = (d < 0).sum(axis=1), (d > 0).sum(axis=1)
    whole = (inside > 0) & (outside == 0)
    kept = faces[whole]
    edge_on = np.flatnonzero((d[whole] == 0).sum(axis=1) == 2)
    touching = kept[edge_on]
    along = touching[distance[touching] == 0].reshape(-1, 2)
    one = _rolled(faces, d < 0, (inside == 1) & (outside > 0))
    two = _rolled(faces, d > 0, (inside == 2) & (outside == 1))
    starts = np.concatenate([one[:, 0], one[:, 0], two[:, 1], two[:, 2]])
    ends = np.concatenate([one[:, 1], one[:, 2], two[:, 0], two[:, 0]])
    crossings, new = _cross_edges(surface.points, distance, starts, ends)
    p, q, r, s = np.split(new, np.cumsum([len(one), len(one), len(two)]))
    pieces = [
        kept,
        np.stack([one[:, 0], p, q], axis=1),
        np.stack([r, two[:, 1], two[:, 2]], axis=1),
        np.stack([r, two[:, 2], s], axis=1),
    ]
    segments = np.concatenate([along, np.stack([p, q], axis=1), np.stack([s, r], axis=1)])
    points = np.concatenate([surface.points, crossings])
    starts = np.cumsum([len(piece) for piece in pieces])
    owners = np.concatenate(
        [edge_on, starts[0] + np.arange(len(one)), starts[2] + np.arange(len(two))]
    )
    side = np.concatenate(pieces)
    used = np.unique(side)
    surface = Surface(points[used], np.searchsorted(used, side))
    return surface, np.searchsorted(used, segments), owners


def _cross_edges(
    points: Array, distance: Array, starts: Indices, ends: Indices
) -> tuple[Array, Indices]:
    """Return where edges cross the plane (k, 3), and the index of each edge's crossing.

    The crossings follow ``points``. An edge that ends on the plane crosses it in that very point.
    """
    codes, edges = np.unique(starts * len(points) + ends, return_inverse=True)
    first, last = np.divmod(codes, len(points))
    share = distance[first] / (distance[first] - distance[last])
    a, b = points[first], points[last]
    indices = np.where(distance[last] == 0, last, len(points) + np.arange(len(codes)))
    return a + (b - a) * share[:, None], indices[edges]


def _rolled(faces: Indices, lone: NDArray[np.bool_], chosen: NDArray[np.bool_]) -> Indices:
    """Return the chosen faces, turned so that their lone corner comes first."""
    first = np.argmax(lone[chosen], axis=1)
    columns = (first[:, None] + np.arange(3)) % 3
    rolled: Indices = np.take_along_axis(faces[chosen], columns, axis=1)
    return rolled


def _cap(side: Surface, segments: Indices, owners: Indices, axis: int) -> Surface:
    """Close the cut whose outline the segments are, by trapezoids between each two of them.

    A corner of a trapezoid on a segment divides the face that the segment belongs to, its owner, so
    that further cuts still find them connected.
    """
    u, v = (axis + 1) % 3, (axis + 2) % 3
    backwards = side.points[segments[:, 0], u] > side.points[segments[:, 1], u]
    segments = np.where(backwards[:, None], segments[:, ::-1], segments)
    low, high = side.points[segments[:, 0]], side.points[segments[:, 1]]
    bounds = np.unique(np.concatenate([low[:, u], high[:, u]]))
    bounds = bounds[np.concatenate([[True], np.diff(bounds) > 1e-7])]
    points, count = [side.points], len(side.points)
    corners: dict[tuple[int, float], int] = {}
    faces: list[tuple[int, int, int]] = []
    slope = (high - low) / np.maximum(high[:, u] - low[:, u], 1e-12)[:, None]
    for start, end in pairwise(bounds.tolist()):
        middle = (start + end) / 2
        crossing = np.flatnonzero((low[:, u] < middle) & (high[:, u] > middle))
        heights = low[crossing, v] + slope[crossing, v] * (middle - low[crossing, u])
        crossing = crossing[np.argsort(heights, kind="stable")][: len(crossing) // 2 * 2]
        for level in (start, end):
            for segment in crossing.tolist():
                if (segment, level) in corners:
                    continue
                if level < low[segment, u] + 1e-7:
                    corners[segment, level] = int(segments[segment, 0])
                elif level > high[segment, u] - 1e-7:
                    corners[segment, level] = int(segments[segment, 1])
                else:
                    corners[segment, level] = count
                    points.append((low[segment] + slope[segment] * (level - low[segment, u]))[None])
                    count += 1
        for below, above in zip(crossing[::2].tolist(), crossing[1::2].tolist(), strict=True):
            a, b = corners[below, start], corners[below, end]
            c, d = corners[above, end], corners[above, start]
            faces += [(a, b, c), (a, c, d)]
    divided = _divide_owners(side.faces, segments, owners, corners, len(side.points))
    trapezoids = np.array(faces, dtype=np.int64).reshape(-1, 3)
    trapezoids = trapezoids[(trapezoids != np.roll(trapezoids, 1, axis=1)).all(axis=1)]
    return Surface(np.concatenate(points), np.concatenate([divided, trapezoids]))


def _divide_owners(
    faces: Indices,
    segments: Indices,
    owners: Indices,
    corners: dict[tuple[int, float], int],
    count: int,
) -> Indices:
    """Return the faces, those divided that have corners, numbered from ``count``, on an edge."""
    inner: dict[int, list[tuple[float, int]]] = {}
    for (segment, level), corner in corners.items():
        if corner >= count:
            inner.setdefault(segment, []).append((level, corner))
    new: list[tuple[int, int, int]] = []
    for segment, divisions in inner.items():
        first, last = segments[segment].tolist()
        apex = next(i for i in faces[owners[segment]].tolist() if i not in (first, last))
        chain = [first, *(corner for _, corner in sorted(divisions)), last]
        new += [(apex, i, j) for i, j in pairwise(chain)]
    kept = np.delete(faces, owners[list(inner)], axis=0)
    return np.concatenate([kept, np.array(new, dtype=np.int64).reshape(-1, 3)])
