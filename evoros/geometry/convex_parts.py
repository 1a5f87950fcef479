"""Divide surfaces into convex parts, exactly where cuts by planes can."""

import heapq
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from evoros.base.arrays import Array
from evoros.base.linear import product
from evoros.geometry.cuts import cut
from evoros.geometry.hull import MOST_CORNERS, Hull, hull_volume, make_hull, simplify
from evoros.geometry.triangles import Indices, Surface, find_normals, sample, split_by_points

MOST_PARTS = 64
_MANY = 5000  # faces, of which only every second, third ... is looked at if there are more
_SUSPECTS = 32  # faces of a hollow that are looked at
_FINE = 300  # faces, above which fewer cuts are tried


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a surface, and how well its hull stands for it."""

    surface: Surface
    hull: Hull
    depth: float  # [m] of the surface in the hull, at most
    concavity: float  # largest distance [m] of the surface from the hull's, or back
    suspects: Indices  # indices of the faces of the deepest hollows, the deepest ones first


def make_piece(surface: Surface) -> Piece | None:
    """Return the piece of a surface; None if it is too small to count."""
    hull = make_hull(surface.points)
    if hull is None:
        return None
    looked_at = np.arange(0, len(surface.faces), 1 + len(surface.faces) // _MANY)
    depths = _depths(surface.triangles[looked_at], hull)
    depth = max(float(depths.max()), 0.0)
    extent = float(np.ptp(surface.points, axis=0).max())
    deepest = np.argsort(-depths, kind="stable")[:_SUSPECTS]
    deepest = looked_at[deepest[depths[deepest] > 0.5 * depth]]
    if depth < 1e-4 * extent and abs(hull.area - surface.area) < 1e-4 * hull.area:
        return Piece(surface, hull, depth, depth, deepest)
    gap, nearest = _widest_gap(surface, hull, extent)
    suspects = [deepest, nearest] if depth > gap else [nearest, deepest]
    return Piece(surface, hull, depth, max(depth, gap), np.concatenate(suspects))


def find_gap(surface: Surface) -> float:
    """Return how far [m] the hull of a surface bridges its hollows."""
    hull = make_hull(surface.points)
    extent = float(np.ptp(surface.points, axis=0).max())
    return 0.0 if hull is None else _widest_gap(surface, hull, extent)[0]


def _depths(corners: Array, hull: Hull) -> Array:
    """Return how deep [m] in the hull each of the triangles (n, 3, 3) lies."""
    # A valley may end on the hull, so its middle counts, too.
    samples = [corners[:, i] for i in range(3)]
    samples += [(corners[:, i] + corners[:, i - 1]) / 2 for i in range(3)]
    samples.append(corners.mean(axis=1))
    # A hull with few corners is a little smaller, and much faster.
    simple = simplify(hull)[0] if len(hull.corners) > MOST_CORNERS else hull
    depths: Array = simple.depth(np.concatenate(samples)).reshape(len(samples), -1).max(axis=0)
    return depths


def _widest_gap(surface: Surface, hull: Hull, extent: float) -> tuple[float, Indices]:
    """Return how far [m] the hull bridges hollows, and the faces around the widest of them.

    A hollow with thin walls, such as a room, is nowhere deep inside its hull, but wide.
    """
    # Fine enough for a door in a wall of any length, unless that takes too many points.
    step = min(max(extent / 20, 0.01), 0.25 if extent < 10.0 else 0.4)
    step = max(step, float(np.sqrt((hull.area + surface.area) / 1e5)))
    points, owners = sample(surface.triangles, step / 2)
    tree = cKDTree(points)
    bridges, _ = sample(hull.corners[hull.faces], step)
    distances, _ = tree.query(bridges)
    widest = int(np.argmax(distances))
    gap = max(float(distances[widest]) - 0.4 * step, 0.0)
    _, near = tree.query(bridges[widest], k=min(50 * _SUSPECTS, len(points)))
    _, first = np.unique(owners[near], return_index=True)
    return gap, owners[near][np.sort(first)][:_SUSPECTS]


def divide(
    piece: Piece, tolerance: float, closed: bool, most: int = MOST_PARTS, work: float = np.inf
) -> list[Piece]:
    """Cut a piece into pieces until their concavity [m] is within the tolerance.

    The piece with the deepest hollow is cut first. ``most`` limits the number of pieces, and
    ``work`` the number of faces that are looked at in all cuts tried.
    """
    done: list[Piece] = []
    waiting = [(-piece.concavity, 0, piece)]
    serial = 0
    while waiting:
        concavity, _, worst = heapq.heappop(waiting)
        pieces: list[Piece] = []
        if -concavity > tolerance and len(done) + len(waiting) + 1 < most and work > 0:
            planes = _candidates(worst)
            work -= len(planes) * len(worst.surface.faces)
            pieces = _best_cut(worst, planes, closed)
        if not pieces:
            done.append(worst)
        for part in pieces:
            serial += 1
            heapq.heappush(waiting, (-part.concavity, serial, part))
    return done


def _best_cut(piece: Piece, planes: list[tuple[Array, float]], closed: bool) -> list[Piece]:
    """Cut a piece by the plane that leaves the smallest hulls; no pieces if none divides it."""
    best: tuple[float, int] | None = None
    plane = None
    for normal, offset in planes:
        volumes = [
            hull_volume(part.points)
            for side in cut(piece.surface, normal, offset, capped=False)
            for part in split_by_points(side)
        ]
        if len(volumes) < 2:
            continue
        score = (round(sum(volumes) / piece.hull.volume, 6), len(volumes))
        if best is None or score < best:
            best, plane = score, (normal, offset)
    if plane is None:
        return []
    parts = [
        part for side in cut(piece.surface, *plane, capped=closed) for part in split_by_points(side)
    ]
    return [made for part in parts if (made := make_piece(part)) is not None]


def merge(pieces: list[Piece]) -> list[Piece]:
    """Merge pieces that are convex together, which a cut has separated for another one's sake."""
    waiting, done = list(pieces), []
    while waiting:
        piece = waiting.pop(0)
        for index, other in enumerate(waiting):
            union = _union(piece, other)
            if union is not None:
                waiting[index] = union
                break
        else:
            done.append(piece)
    return done


def _union(first: Piece, second: Piece) -> Piece | None:
    """Return the piece of both if their hulls fill its hull."""
    a, b = first.hull.corners, second.hull.corners
    if (a.min(axis=0) > b.max(axis=0) + 1e-6).any() or (b.min(axis=0) > a.max(axis=0) + 1e-6).any():
        return None
    hull = make_hull(np.concatenate([a, b]))
    volume = first.hull.volume + second.hull.volume
    if hull is None or abs(hull.volume - volume) > 1e-4 * volume:
        return None
    depth, concavity = max(first.depth, second.depth), max(first.concavity, second.concavity)
    return Piece(first.surface, hull, depth, concavity, first.suspects)


def _candidates(piece: Piece) -> list[tuple[Array, float]]:
    """Return planes (normal, offset [m]) at the deepest faces, along them and along the axes."""
    tried = 8 if len(piece.surface.faces) <= _FINE else 3
    corners = piece.surface.triangles[piece.suspects]
    normals = find_normals(corners)
    lengths = np.sqrt((normals * normals).sum(axis=1))
    planes: dict[tuple[float, ...], tuple[Array, float]] = {}
    for i in np.flatnonzero(lengths > 1e-12):
        normal = normals[i] / lengths[i]
        normal = normal * np.sign(normal[np.argmax(np.abs(normal))])
        offset = float(product(corners[i, 0], normal))
        sides = product(piece.hull.corners, normal) - offset
        if sides.min() < -1e-6 and sides.max() > 1e-6:
            _add(planes, normal, offset)
        if len(planes) >= tried:
            break
    corners = corners[: 2 * tried]
    low, high = piece.surface.points.min(axis=0), piece.surface.points.max(axis=0)
    for axis in range(3):
        levels = np.unique(corners[:, :, axis])
        levels = levels[(levels > low[axis] + 1e-6) & (levels < high[axis] - 1e-6)]
        chosen = np.unique(np.linspace(0, len(levels) - 1, tried).round().astype(int))
        for level in levels[chosen] if len(levels) else ():
            _add(planes, np.eye(3)[axis], float(level))
    return list(planes.values())


def _add(
    planes: dict[tuple[float, ...], tuple[Array, float]], normal: Array, offset: float
) -> None:
    planes.setdefault((*np.round(normal, 6).tolist(), round(offset, 6)), (normal, offset))
