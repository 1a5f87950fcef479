"""Divide flat polygons into convex ones by merging triangles along their longest edges."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from evoros.base.arrays import Array
from evoros.base.linear import length
from evoros.geometry.triangles import (
    Indices,
    Surface,
    find_normals,
    group_connected,
    list_edges,
)

Ring = list[tuple[float, float]]

_FLAT = 1e-6  # [m] and [rad]: deviation up to which faces lie in one plane


def divide_into_polygons(surface: Surface) -> list[Array]:
    """Return convex polygons (k, 3) [m] that cover the surface, facet by facet."""
    corners = surface.triangles
    normals = find_normals(corners)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    # The two sides of a sheet count as one plane.
    largest = np.abs(normals).argmax(axis=1)[:, None]
    normals *= np.sign(np.take_along_axis(normals, largest, axis=1))
    polygons: list[Array] = []
    for group in _facets(surface.faces, normals, (normals * corners[:, 0]).sum(axis=1)):
        polygons += _merge(surface.points, surface.faces[group], normals[group[0]])
    return polygons


def _facets(faces: Indices, normals: Array, offsets: Array) -> list[Indices]:
    """Return the face indices of each facet, a set of connected faces in one plane."""
    edges = list_edges(faces)
    owners = np.tile(np.arange(len(faces)), 3)
    order = np.lexsort((owners, edges[:, 1], edges[:, 0]))
    same = (edges[order[:-1]] == edges[order[1:]]).all(axis=1)
    a, b = owners[order[:-1]][same], owners[order[1:]][same]
    flat = np.abs(normals[a] - normals[b]).max(axis=1) < _FLAT
    flat &= np.abs(offsets[a] - offsets[b]) < _FLAT
    return group_connected(a[flat], b[flat], len(faces), len(faces))


def _merge(points: Array, faces: Indices, normal: Array) -> list[Array]:
    """Merge the triangles of a facet across their longest edges while the result stays convex."""
    axis = int(np.abs(normal).argmax())
    used, corners = np.unique(faces, return_inverse=True)
    points = points[used]
    flat = points[:, [(axis + 1) % 3, (axis + 2) % 3]].tolist()
    loops: dict[int, list[int]] = {}
    owner: dict[tuple[int, int], int] = {}
    for index, (i, j, k) in enumerate(corners.reshape(-1, 3).tolist()):
        loop = [i, j, k] if _turn(flat, i, j, k) > 0 else [i, k, j]
        loops[index] = loop
        owner |= dict.fromkeys(_edges_of(loop), index)
    inner = [(i, j) for i, j in owner if i < j and (j, i) in owner]
    inner.sort(key=lambda edge: (-length(points[edge[0]] - points[edge[1]]), edge))
    for i, j in inner:
        first, second = owner[i, j], owner[j, i]
        merged = _join(loops[first], loops[second], i, j)
        if first != second and _is_convex(flat, merged):
            del loops[second]
            loops[first] = merged
            owner |= dict.fromkeys(_edges_of(merged), first)
    return [points[loop] for loop in loops.values()]


def _edges_of(loop: list[int]) -> list[tuple[int, int]]:
    return list(zip(loop, loop[1:] + loop[:1], strict=True))


def _join(first: list[int], second: list[int], i: int, j: int) -> list[int]:
    """Return the loop around two loops; the first has the edge i to j, the second j to i."""
    a, b = first.index(j), second.index(i)
    return (first[a:] + first[:a])[:-1] + (second[b:] + second[:b])[:-1]


def _turn(flat: list[list[float]], i: int, j: int, k: int) -> float:
    """Return twice the area [m2] of a triangle, positive if it is counter-clockwise."""
    (ax, ay), (bx, by), (cx, cy) = flat[i], flat[j], flat[k]
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


def _is_convex(flat: list[list[float]], loop: list[int]) -> bool:
    if len(set(loop)) < len(loop):
        return False
    turns = (_turn(flat, loop[n - 2], loop[n - 1], loop[n]) >= -1e-12 for n in range(len(loop)))
    return all(turns)


def decompose(rings: Sequence[Ring]) -> list[Ring]:
    """Return convex counter-clockwise polygons that together cover the inside of the rings.

    A ring inside another ring is a hole. A ring must not cross itself or another ring.

    Raises:
        ValueError: a ring crosses itself or another ring, or encloses nothing.
    """
    from manifold3d import CrossSection, FillRule, triangulate

    areas = [CrossSection([np.array(ring)], FillRule.EvenOdd) for ring in rings]
    for ring, area in zip(rings, areas, strict=True):
        x, y = np.array(ring).T
        enclosed = abs(float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum()) / 2)
        if enclosed < 1e-12:
            raise ValueError("it encloses nothing")
        if abs(area.area() - enclosed) > 1e-6 * enclosed:
            raise ValueError("it crosses itself")
    for one, other in combinations(areas, 2):
        common, smaller = (one ^ other).area(), min(one.area(), other.area())
        if 1e-6 * smaller < common < (1 - 1e-6) * smaller:
            raise ValueError("it crosses itself")
    polygons = CrossSection([np.array(ring) for ring in rings], FillRule.EvenOdd).to_polygons()
    corners = np.concatenate(polygons)
    points = np.column_stack([corners, np.zeros(len(corners))])
    pieces = divide_into_polygons(Surface(points, np.asarray(triangulate(polygons), np.int64)))
    return [[(x, y) for x, y, _ in piece.tolist()] for piece in pieces]
