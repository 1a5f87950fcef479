"""Divide a surface that encloses nothing into convex polygons."""

import numpy as np

from evoros.base.arrays import Array
from evoros.base.linear import length
from evoros.geometry.triangles import Indices, Surface, find_normals, group_connected, list_edges

_FLAT = 1e-6  # [m] and [rad]: how far faces of one plane may be off it


def divide_into_polygons(surface: Surface) -> list[Array]:
    """Return convex polygons (k, 3) [m] that cover the surface: its facets, divided if need be."""
    corners = surface.triangles
    normals = find_normals(corners)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    # The two sides of a sheet are one plane.
    largest = np.abs(normals).argmax(axis=1)[:, None]
    normals *= np.sign(np.take_along_axis(normals, largest, axis=1))
    polygons: list[Array] = []
    for group in _facets(surface.faces, normals, (normals * corners[:, 0]).sum(axis=1)):
        loops = _merge(surface.points, surface.faces[group], normals[group[0]])
        polygons += [surface.points[loop] for loop in loops]
    return polygons


def _facets(faces: Indices, normals: Array, offsets: Array) -> list[Indices]:
    """Return the indices of the faces of each facet: connected, and in one plane."""
    edges = list_edges(faces)
    owners = np.tile(np.arange(len(faces)), 3)
    order = np.lexsort((owners, edges[:, 1], edges[:, 0]))
    same = (edges[order[:-1]] == edges[order[1:]]).all(axis=1)
    a, b = owners[order[:-1]][same], owners[order[1:]][same]
    flat = np.abs(normals[a] - normals[b]).max(axis=1) < _FLAT
    flat &= np.abs(offsets[a] - offsets[b]) < _FLAT
    return group_connected(a[flat], b[flat], len(faces), len(faces))


def _merge(points: Array, faces: Indices, normal: Array) -> list[list[int]]:
    """Merge the triangles of a facet over their longest edges, as long as they stay convex."""
    axis = int(np.abs(normal).argmax())
    flat = points[:, [(axis + 1) % 3, (axis + 2) % 3]].tolist()
    loops: dict[int, list[int]] = {}
    owner: dict[tuple[int, int], int] = {}
    for index, (i, j, k) in enumerate(faces.tolist()):
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
    return list(loops.values())


def _edges_of(loop: list[int]) -> list[tuple[int, int]]:
    return list(zip(loop, loop[1:] + loop[:1], strict=True))


def _join(first: list[int], second: list[int], i: int, j: int) -> list[int]:
    """Return the loop around two loops; the first has the edge from i to j, the second back."""
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
