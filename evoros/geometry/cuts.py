"""Cut surfaces of triangles by planes, and close the cuts."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.geometry.triangles import Indices, Surface


def cut(surface: Surface, normal: Array, offset: float, capped: bool) -> list[Surface]:
    """Return what lies below and above the plane ``normal . p = offset``, if anything does.

    ``capped`` closes the cuts of a closed surface.
    """
    distance = surface.points @ normal - offset
    distance[np.abs(distance) < 1e-6] = 0.0
    sides = []
    for sign in (1.0, -1.0):
        side, segments = _clip(surface, sign * distance)
        if capped and len(segments):
            side = _cap(side, segments, normal)
        if len(side.faces):
            sides.append(side)
    return sides


def _clip(surface: Surface, distance: Array) -> tuple[Surface, Indices]:
    """Return the part at negative distances, and the segments (m, 2) along which it was cut.

    A face in the plane itself belongs to neither side, whose caps take its place.
    """
    faces, d = surface.faces, distance[surface.faces]
    inside, outside = (d < 0).sum(axis=1), (d > 0).sum(axis=1)
    whole = (inside > 0) & (outside == 0)
    kept = faces[whole]
    touching = kept[(d[whole] == 0).sum(axis=1) == 2]
    along = touching[distance[touching] == 0].reshape(-1, 2)
    one = _rolled(faces, d < 0, (inside == 1) & (outside > 0))
    two = _rolled(faces, d > 0, (inside == 2) & (outside == 1))
    starts = np.concatenate([one[:, 0], one[:, 0], two[:, 1], two[:, 2]])
    ends = np.concatenate([one[:, 1], one[:, 2], two[:, 0], two[:, 0]])
    codes, new = np.unique(starts * len(surface.points) + ends, return_inverse=True)
    first, last = np.divmod(codes, len(surface.points))
    share = distance[first] / (distance[first] - distance[last])
    a, b = surface.points[first], surface.points[last]
    crossings = a + (b - a) * share[:, None]
    # Where an edge ends on the plane, it crosses it in that very point.
    numbers = np.where(distance[last] == 0, last, len(surface.points) + np.arange(len(codes)))
    new = numbers[new]
    p, q, r, s = np.split(new, np.cumsum([len(one), len(one), len(two)]))
    pieces = [
        kept,
        np.stack([one[:, 0], p, q], axis=1),
        np.stack([r, two[:, 1], two[:, 2]], axis=1),
        np.stack([r, two[:, 2], s], axis=1),
    ]
    segments = np.concatenate([along, np.stack([p, q], axis=1), np.stack([s, r], axis=1)])
    points = np.concatenate([surface.points, crossings])
    return _joined(points, np.concatenate(pieces), segments)


def _rolled(faces: Indices, lone: NDArray[np.bool_], chosen: NDArray[np.bool_]) -> Indices:
    """Return the chosen faces, turned so that their lone corner comes first."""
    first = np.argmax(lone[chosen], axis=1)
    columns = (first[:, None] + np.arange(3)) % 3
    rolled: Indices = np.take_along_axis(faces[chosen], columns, axis=1)
    return rolled


def _joined(points: Array, faces: Indices, segments: Indices) -> tuple[Surface, Indices]:
    """Return the surface without unused points, and the segments by its indices."""
    used, indices = np.unique(faces, return_inverse=True)
    renamed = np.searchsorted(used, segments)
    return Surface(points[used], indices.reshape(-1, 3)), renamed


def _cap(side: Surface, segments: Indices, normal: Array) -> Surface:
    """Close the cut whose outline the segments are, by trapezoids between each two of them."""
    axis = int(np.argmax(np.abs(normal)))
    u, v = (axis + 1) % 3, (axis + 2) % 3
    flat = side.points[segments][:, :, [u, v]]
    swap = flat[:, 0, 0] > flat[:, 1, 0]
    segments = np.where(swap[:, None], segments[:, ::-1], segments)
    low, high = side.points[segments[:, 0]], side.points[segments[:, 1]]
    bounds = np.unique(flat[:, :, 0])
    bounds = bounds[np.concatenate([[True], np.diff(bounds) > 1e-7])]
    points, faces, count = [side.points], [side.faces], len(side.points)
    for start, end in pairwise(bounds.tolist()):
        middle = (start + end) / 2
        crossing = np.flatnonzero((low[:, u] < middle) & (high[:, u] > middle))
        a, b = low[crossing], high[crossing]
        slope = (b - a) / (b[:, u] - a[:, u])[:, None]
        order = np.argsort((a + slope * (middle - a[:, u])[:, None])[:, v], kind="stable")
        order = order[: len(order) // 2 * 2]
        left = (a + slope * np.maximum(start - a[:, u], 0.0)[:, None])[order]
        right = (a + slope * np.minimum(end - a[:, u], b[:, u] - a[:, u])[:, None])[order]
        owners = segments[crossing[order]][:, 0]
        i = count + np.arange(0, len(order), 2)  # lower points on the left; the upper ones follow
        j = i + len(order)
        points += [left, right]
        faces += [np.stack([i, j, j + 1], axis=1), np.stack([i, j + 1, i + 1], axis=1)]
        # Faces without an area tie the trapezoids to the outline, so that they stay one part.
        tied = count + np.arange(len(order))
        faces.append(np.stack([owners, tied, tied], axis=1))
        count += 2 * len(order)
    return Surface(np.concatenate(points), np.concatenate(faces))
