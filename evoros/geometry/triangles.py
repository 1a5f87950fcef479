"""Triangle surfaces: shared points, connected parts and sampling."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array

Indices = NDArray[np.integer]


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles that share points."""

    points: Array  # (k, 3) [m]
    faces: Indices  # (n, 3): indices of points
    is_hollow: bool = False  # whether faces enclose a cavity

    @property
    def triangles(self) -> Array:
        """The corners (n, 3, 3) [m] of each face."""
        return np.asarray(self.points[self.faces])

    @property
    def area(self) -> float:
        """The area [m2] of all faces."""
        normals = find_normals(self.triangles)
        return float(np.sqrt((normals * normals).sum(axis=1)).sum()) / 2

    @property
    def volume(self) -> float:
        """The volume [m3] enclosed by a closed surface, negative if the faces point inwards."""
        a, b, c = np.moveaxis(self.triangles - self.points[0], 1, 0)
        return float((a * np.cross(b, c)).sum() / 6)


def weld(triangles: Array) -> Surface:
    """Return the surface of triangles (n, 3, 3) [m], merging corners within a micrometre."""
    corners = triangles.reshape(-1, 3)
    # Whole micrometres would split coordinates that end in half a micrometre, such as 1/16 inch.
    first, indices = unique_rows(np.round(corners * 1.03e6))
    points, faces = corners[first], indices.reshape(-1, 3)
    faces = faces[_have_area(points, faces)]
    first, _ = unique_rows(np.sort(faces, axis=1))
    return compact(points, faces[np.sort(first)])


def _have_area(points: Array, faces: Indices) -> NDArray[np.bool_]:
    distinct_corners = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    sizes = np.abs(find_normals(points[faces])).max(axis=1, initial=0.0)
    return np.asarray(distinct_corners & (sizes > 1e-12))


def join_near(surface: Surface, cell: float) -> tuple[Surface, Indices, float]:
    """Join points per cube of ``cell`` [m]; return faces with area, indices, maximum shift [m]."""
    _, indices = unique_rows(np.floor(surface.points / cell))
    sums = np.stack([np.bincount(indices, column) for column in surface.points.T], axis=1)
    points = sums / np.bincount(indices)[:, None]
    faces = indices[surface.faces]
    kept = np.flatnonzero(_have_area(points, faces))
    error = float(np.linalg.norm(points[indices] - surface.points, axis=1).max())
    return compact(points, faces[kept]), kept, error


def find_normals(triangles: Array) -> Array:
    """Return the normals (n, 3) of triangles (n, 3, 3); their lengths are twice the areas [m2]."""
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def unique_rows(rows: NDArray[Any]) -> tuple[Indices, Indices]:
    """Return the first index of each distinct row, sorted by row, and each row's place there."""
    order = np.lexsort(rows.T[::-1])
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    indices = np.empty(len(rows), dtype=np.int64)
    indices[order] = np.cumsum(new) - 1
    return order[new], indices


def is_closed(surface: Surface) -> bool:
    """Return True if each edge of the surface belongs to an even number of faces."""
    numbers = _number_edges(list_edges(surface.faces), len(surface.points))
    return not (np.unique(numbers, return_counts=True)[1] % 2).any()


def sample(triangles: Array, step: float) -> tuple[Array, Indices]:
    """Return points (m, 3) on triangles, about ``step`` [m] apart, and the triangle of each."""
    sides = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2)
    # Rotate corners so that the longest side joins the first and second
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


def list_edges(faces: Indices) -> Indices:
    """Return the edges (3 n, 2) of n faces, each with the smaller index first."""
    return np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)


def orient(surface: Surface) -> Surface:
    """Flip faces of a connected surface so that neighbouring faces have the same outside."""
    faces, count = surface.faces, len(surface.faces)
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    numbers = _number_edges(ends, len(surface.points))
    _, edges, sizes = np.unique(numbers, return_inverse=True, return_counts=True)
    order = np.argsort(edges, kind="stable")
    first, second = order[sizes[edges[order]] == 2].reshape(-1, 2).T
    differ = ends[first, 0] == ends[second, 0]
    if not differ.any():
        return surface
    # Each face has two nodes, unchanged and flipped; nodes that agree are connected.
    a, b = first % count, second % count
    one, other = (
        np.concatenate([a, a + count]),
        np.concatenate([np.where(differ, b + count, b), np.where(differ, b, b + count)]),
    )
    turned, known = np.zeros(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    for group in group_connected(one, other, 2 * count, 2 * count):
        if not known[group % count].any():
            turned[group % count] = group >= count
            known[group % count] = True
    return Surface(surface.points, np.where(turned[:, None], faces[:, ::-1], faces))


def separate(surface: Surface) -> Surface | None:
    """Return the surface facing outwards, with touching parts separated; None if not closed."""
    found = _separate(surface)
    if found is None:
        return None
    separated, origins = found
    edges, counts = np.unique(list_edges(separated.faces), axis=0, return_counts=True)
    shared = edges[counts > 2]
    return separate(_halve(surface, origins[shared])) if len(shared) else separated


def _halve(surface: Surface, edges: Indices) -> Surface:
    """Return the surface with the midpoints of the edges (n, 2) inserted."""
    faces, count = surface.faces, len(surface.points)
    size = count + len(edges)
    wanted, first = np.unique(_number_edges(edges, size), return_index=True)
    while True:  # each round halves one edge of each affected face
        codes = np.stack([_number_edges(np.roll(faces, -i, 1)[:, :2], size) for i in range(3)], 1)
        is_halved = np.isin(codes, wanted)
        chosen = is_halved.any(axis=1)
        if not chosen.any():
            middles = surface.points[edges[first]].mean(axis=1)
            return Surface(np.concatenate([surface.points, middles]), faces, surface.is_hollow)
        side = is_halved[chosen].argmax(axis=1)[:, None]
        one, other, tip = np.take_along_axis(faces[chosen], (side + np.arange(3)) % 3, 1).T
        middle = count + np.searchsorted(wanted, np.take_along_axis(codes[chosen], side, 1)[:, 0])
        parts = np.c_[one, middle, tip], np.c_[middle, other, tip]
        faces = np.concatenate([faces[~chosen], *parts])


def _number_edges(edges: Indices, size: int) -> Indices:
    """Return a number for each edge (n, 2) between ``size`` points, equal for both directions."""
    numbers: Indices = edges.min(axis=1) * size + edges.max(axis=1)
    return numbers


def _separate(surface: Surface) -> tuple[Surface, Indices] | None:
    """Separate points without halving edges; return the surface and each point's old index."""
    faces, count = surface.faces, len(surface.faces)
    starts, ends = faces.T.ravel(), np.roll(faces, -1, axis=1).T.ravel()
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    _, edges = np.unique(low * len(surface.points) + high, return_inverse=True)
    sizes, rises = np.bincount(edges), starts < ends
    if (2 * np.bincount(edges, rises) != sizes).any():
        return None
    turns = np.zeros(3 * count)
    crowded = np.flatnonzero(sizes[edges] > 2)
    apexes = surface.points[np.roll(faces, 1, axis=1).T.ravel()[crowded]]
    turns[crowded] = _find_turns(
        surface.points[low[crowded]], surface.points[high[crowded]], apexes, edges[crowded]
    )
    order = np.lexsort((rises, turns, edges))
    first = order[np.cumsum(sizes) - sizes]
    turns[first[rises[first]]] = np.inf
    # The solid at an edge lies between a face that runs along the edge towards the lower index and
    # the next face, which runs in the opposite direction.
    down, up = np.lexsort((rises, turns, edges)).reshape(-1, 2).T
    if rises[down].any() or not rises[up].all():
        return None
    one = np.concatenate([down, (down + count) % (3 * count)])
    other = np.concatenate([(up + count) % (3 * count), up])
    corners = group_connected(one, other, 3 * count, 3 * count)
    indices = np.empty(3 * count, dtype=np.int64)
    for index, group in enumerate(corners):
        indices[group] = index
    origins = starts[[group[0] for group in corners]]
    faces = indices.reshape(3, count).T
    return Surface(surface.points[origins], faces, surface.is_hollow), origins


def _find_turns(low: Array, high: Array, apexes: Array, edges: Indices) -> Array:
    """Return numbers from 0 to 4 that increase with the faces' angles about their edges (n, 3)."""
    along = high - low
    along /= np.linalg.norm(along, axis=1)[:, None]
    across = apexes - low
    across -= along * (along * across).sum(axis=1)[:, None]
    across /= np.maximum(np.linalg.norm(across, axis=1), 1e-12)[:, None]
    _, first, own = np.unique(edges, return_index=True, return_inverse=True)
    zero = across[first][own]
    cosine = (across * zero).sum(axis=1)
    sine = (across * np.cross(along, zero)).sum(axis=1)
    return np.asarray(np.where(sine >= 0.0, 1.0 - cosine, 3.0 + cosine))


def split_by_edges(surface: Surface) -> list[Surface]:
    """Return the parts of a surface that are connected by edges."""
    numbers = _number_edges(list_edges(surface.faces), len(surface.points))
    _, owners = np.unique(numbers, return_inverse=True)
    count = len(surface.faces)
    faces = np.tile(np.arange(count), 3)
    size = count + int(owners.max(initial=-1)) + 1
    groups = group_connected(faces, owners + count, size, count)
    return [compact(surface.points, surface.faces[group]) for group in groups]


def group_connected(one: Indices, other: Indices, size: int, count: int) -> list[Indices]:
    """Group the first ``count`` of ``size`` nodes by the links ``one`` - ``other``."""
    from scipy.sparse import coo_array  # takes longer to import than most robot files take to read
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(one), dtype=np.int8), (one, other)), shape=(size, size))
    _, labels = connected_components(links, directed=False)
    labels = labels[:count]
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)


def concatenate(surfaces: list[Surface]) -> Surface:
    """Join surfaces into one; the second and later ones are cavities of the first."""
    starts = np.cumsum([0, *(len(surface.points) for surface in surfaces)])
    faces = [surface.faces + start for surface, start in zip(surfaces, starts, strict=False)]
    points = np.concatenate([surface.points for surface in surfaces])
    return Surface(points, np.concatenate(faces), is_hollow=len(surfaces) > 1)


def compact(points: Array, faces: Indices) -> Surface:
    """Return the surface without unused points."""
    used, indices = np.unique(faces, return_inverse=True)
    return Surface(points[used], indices.reshape(-1, 3))
