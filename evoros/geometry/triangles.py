"""Surfaces of triangles: the points that faces share, connected parts, samples."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from evoros.base.arrays import Array

Indices = NDArray[np.integer]


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles over shared points."""

    points: Array  # (k, 3) [m]
    faces: Indices  # (n, 3): indices of points
    is_hollow: bool = False  # some of the faces enclose a cavity

    @property
    def triangles(self) -> Array:
        """The corners (n, 3, 3) [m] of each face."""
        corners: Array = self.points[self.faces]
        return corners

    @property
    def area(self) -> float:
        """The area [m2] of all faces."""
        corners = self.triangles
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return float(np.sqrt((normals * normals).sum(axis=1)).sum()) / 2


def weld(triangles: Array) -> Surface:
    """Return the surface of triangles (n, 3, 3) [m] whose corners coincide to a micrometre.

    Faces without an area are left out, and so are faces that repeat another one.
    """
    corners = triangles.reshape(-1, 3)
    # Not in whole micrometres: halves of them, such as 1/16 inch has, would round up or down.
    grid, indices = unique_rows(np.round(corners * 1.03e6))
    first = np.full(len(grid), len(corners))
    np.minimum.at(first, indices, np.arange(len(corners)))
    points = corners[first]
    faces = indices.reshape(-1, 3)
    normals = np.cross(
        points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]]
    )
    distinct_corners = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    faces = faces[distinct_corners & (np.abs(normals).max(axis=1, initial=0.0) > 1e-12)]
    distinct, group = unique_rows(np.sort(faces, axis=1))
    first = np.full(len(distinct), len(faces))
    np.minimum.at(first, group, np.arange(len(faces)))
    return compact(points, faces[np.sort(first)])


def unique_rows(rows: NDArray[Any]) -> tuple[NDArray[Any], Indices]:
    """Return the distinct rows, sorted, and the index of each row among them."""
    order = np.lexsort(rows.T[::-1])
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    indices = np.empty(len(rows), dtype=np.int64)
    indices[order] = np.cumsum(new) - 1
    return rows[order[new]], indices


def is_closed(surface: Surface) -> bool:
    """Whether each edge of the surface belongs to an even number of faces."""
    edges = _edges(surface)
    _, counts = np.unique(edges[:, 0] * len(surface.points) + edges[:, 1], return_counts=True)
    return not (counts % 2).any()


def sample(triangles: Array, step: float) -> tuple[Array, Indices]:
    """Return points (m, 3) at most about ``step`` [m] apart on triangles, and whose they are."""
    sides = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2)
    # Turned so that the longest side runs from the first corner to the second one.
    turn = (sides.argmax(axis=1)[:, None] - 1 + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(triangles, turn[:, :, None], axis=1), 1, 0)
    longest = sides.max(axis=1)
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / np.maximum(longest, 1e-12)
    columns = np.maximum(np.ceil(longest / step), 1.0).astype(np.int64) + 1
    rows = np.maximum(np.ceil(height / step), 1.0).astype(np.int64) + 1
    counts = columns * rows
    owner = np.repeat(np.arange(len(triangles)), counts)
    index = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    row, column = np.divmod(index, columns[owner])
    t = (row / (rows[owner] - 1))[:, None]
    s = (column / (columns[owner] - 1))[:, None] * (1 - t)
    return a[owner] + (b - a)[owner] * s + (c - a)[owner] * t, owner


def _edges(surface: Surface) -> Indices:
    """Return the edges (3 n, 2) of all faces, the smaller index first."""
    faces = surface.faces
    return np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)


def split_by_edges(surface: Surface) -> list[Surface]:
    """Return the parts of a surface whose faces are connected over edges."""
    edges = _edges(surface)
    codes = edges[:, 0] * len(surface.points) + edges[:, 1]
    _, owners = np.unique(codes, return_inverse=True)
    count = len(surface.faces)
    faces = np.tile(np.arange(count), 3)
    size = count + int(owners.max(initial=-1)) + 1
    return _split(surface, faces, owners + count, size)


def split_by_points(surface: Surface) -> list[Surface]:
    """Return the parts of a surface whose faces are connected over points."""
    count = len(surface.faces)
    faces = np.repeat(np.arange(count), 3)
    return _split(surface, faces, surface.faces.ravel() + count, count + len(surface.points))


def _split(surface: Surface, rows: Indices, columns: Indices, size: int) -> list[Surface]:
    links = coo_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(size, size))
    _, labels = connected_components(links, directed=False)
    labels = labels[: len(surface.faces)]
    order = np.argsort(labels, kind="stable")
    ends = np.flatnonzero(np.diff(labels[order])) + 1
    return [compact(surface.points, surface.faces[group]) for group in np.split(order, ends)]


def concatenate(surfaces: list[Surface]) -> Surface:
    """Return several surfaces as one; all but the first are cavities in it."""
    starts = np.cumsum([0, *(len(surface.points) for surface in surfaces)])
    faces = [surface.faces + start for surface, start in zip(surfaces, starts, strict=False)]
    points = np.concatenate([surface.points for surface in surfaces])
    return Surface(points, np.concatenate(faces), is_hollow=len(surfaces) > 1)


def compact(points: Array, faces: Indices) -> Surface:
    """Return the surface without the points that no face uses."""
    used, indices = np.unique(faces, return_inverse=True)
    return Surface(points[used], indices.reshape(-1, 3))
