"""Convex parts of any surface: hulls where they fit, pieces of solids, plates of sheets."""

from dataclasses import dataclass, replace

import numpy as np

from evoros.base.arrays import Array
from evoros.geometry.convex_parts import MOST_PARTS, Piece, divide, make_piece, merge
from evoros.geometry.hull import Hull, make_hull, simplify
from evoros.geometry.plates import divide_into_polygons
from evoros.geometry.triangles import (
    Surface,
    concatenate,
    find_normals,
    is_closed,
    join_near,
    split_by_edges,
    weld,
)

MOST_PLATES = 128
_MOST_SURFACES = 256  # connected parts of a file
_MOST_FACES = 2000  # of a part that is cut; a finer one is made coarser

_WORK = 2e6  # faces looked at in cuts of a file, which limits the time to seconds


@dataclass(frozen=True, eq=False)
class Parts:
    """Convex parts that stand for a surface."""

    hulls: tuple[Hull, ...]
    dropped: int  # number of parts that are too small to count
    deviation: float  # largest distance [m] from the surface to the parts'


def divide_mesh(triangles: Array) -> Parts:
    """Divide triangles (n, 3, 3) [m] into convex parts."""
    hulls: list[Hull] = []
    dropped = 0
    groups, deviation = _gather(_join_cavities(split_by_edges(weld(triangles))))
    for group in groups:
        if len(group) == 1:
            parts, error = _decompose_part(group[0], _WORK * len(group[0].faces) / len(triangles))
        else:
            parts, error = _clump(group), 0.0
        dropped += not parts
        deviation = max(deviation, error)
        for hull in parts:
            simple, error = simplify(hull)
            hulls.append(simple)
            deviation = max(deviation, error)
    return Parts(tuple(hulls), dropped, deviation)


def _clump(surfaces: list[Surface]) -> list[Hull]:
    hull = make_hull(np.concatenate([surface.points for surface in surfaces]))
    return [] if hull is None else [hull]


def _decompose_part(surface: Surface, work: float) -> tuple[list[Hull], float]:
    """Return the hulls of one connected surface, and their largest deviation [m]."""
    piece = make_piece(surface)
    if piece is None:
        return [], 0.0
    extent = float(np.ptp(surface.points, axis=0).max())
    if surface.is_hollow:
        piece = replace(piece, concavity=extent)
    elif _is_hull(piece, min(max(0.002, 0.01 * extent), 0.02)):
        return [piece.hull], piece.depth
    closed = is_closed(surface)
    if not closed and len(surface.faces) <= _MOST_FACES:
        polygons = divide_into_polygons(surface)
        if len(polygons) <= MOST_PLATES:
            return [hull for points in polygons if (hull := make_hull(points)) is not None], 0.0
    coarse, error = _coarsen(surface, extent)
    if coarse is not surface:
        piece = make_piece(coarse) or piece
    tolerance = min(max(0.01, 0.03 * extent), 0.1)
    most = MOST_PARTS if extent < 5.0 else 4 * MOST_PARTS
    pieces = merge(divide(piece, tolerance, closed, most, work))
    deviation = error + max(p.concavity for p in pieces)
    if closed:
        deviation = max(deviation, _lacking(pieces, surface))
    return [piece.hull for piece in pieces], deviation


def _lacking(pieces: list[Piece], solid: Surface) -> float:
    """Return the edge [m] of a cube as large as the difference in volume between pieces and solid.

    The caps of cuts may fail where parts of a solid touch along an edge only. The difference of
    rounded cuts, up to a thousandth, does not count.
    """
    volume = abs(_signed_volume(solid))
    difference = abs(sum(piece.hull.volume for piece in pieces) - volume)
    return float(np.cbrt(difference)) if difference > 1e-3 * volume else 0.0


def _is_hull(piece: Piece, tolerance: float) -> bool:
    """Whether the surface covers its hull, but for a missing bottom."""
    if piece.depth > tolerance:
        return False
    hull, corners = piece.hull, piece.surface.triangles
    lacking = hull.area - piece.surface.area
    if abs(lacking) <= 0.02 * hull.area:
        return piece.concavity <= tolerance
    # The area vectors of a closed surface cancel out; the rest points into the opening.
    normals = find_normals(corners) / 2
    away = (normals * (corners.mean(axis=1) - hull.corners.mean(axis=0))).sum(axis=1)
    opening = -(normals * np.sign(away)[:, None]).sum(axis=0)
    size = float(np.sqrt((opening * opening).sum()))
    return abs(size - lacking) <= 0.02 * hull.area and float(opening[2]) < -0.7 * size


def _coarsen(surface: Surface, extent: float) -> tuple[Surface, float]:
    """Return a surface of fewer faces, and how far [m] its points moved at most."""
    cell, error, coarse = min(max(extent / 100, 0.002), 0.02), 0.0, surface
    while len(coarse.faces) > _MOST_FACES:
        joined, kept, error = join_near(surface, cell)
        if not len(kept):
            break
        coarse = joined
        cell *= 1.5
    return coarse, error


def _join_cavities(surfaces: list[Surface]) -> list[Surface]:
    """Join each closed surface that is the inner side of another one to that."""
    volumes = [_signed_volume(surface) if is_closed(surface) else 0.0 for surface in surfaces]
    order = sorted(range(len(surfaces)), key=lambda i: (-abs(volumes[i]), i))
    joined: dict[int, list[int]] = {}
    for rank, i in enumerate(order):
        outer = next(
            (j for j in reversed(order[:rank]) if _is_cavity(surfaces, volumes, i, j)), None
        )
        if outer is None or outer not in joined:
            joined[i] = [i]
        else:
            joined[outer].append(i)
    return [concatenate([surfaces[i] for i in joined[outer]]) for outer in sorted(joined)]


def _is_cavity(surfaces: list[Surface], volumes: list[float], inner: int, outer: int) -> bool:
    if volumes[inner] * volumes[outer] >= 0.0:
        return False
    a, b = surfaces[inner].points, surfaces[outer].points
    return bool((a.min(axis=0) > b.min(axis=0)).all() and (a.max(axis=0) < b.max(axis=0)).all())


def _signed_volume(surface: Surface) -> float:
    """Return the volume [m3] of a closed surface, negative if its faces point inwards."""
    a, b, c = np.moveaxis(surface.triangles - surface.points[0], 1, 0)
    return float((a * np.cross(b, c)).sum() / 6)


def _gather(surfaces: list[Surface]) -> tuple[list[list[Surface]], float]:
    """Group small neighbours into at most ``_MOST_SURFACES`` clumps of a width [m]."""
    if len(surfaces) <= _MOST_SURFACES:
        return [[surface] for surface in surfaces], 0.0
    low = np.array([surface.points.min(axis=0) for surface in surfaces])
    high = np.array([surface.points.max(axis=0) for surface in surfaces])
    extents = (high - low).max(axis=1)
    cell = float((high.max(axis=0) - low.min(axis=0)).max()) / 200
    groups: dict[tuple[float, ...], list[Surface]] = {}
    while len(groups) == 0 or len(groups) > _MOST_SURFACES:
        groups = {}
        cells = np.floor((low + high) / 2 / cell).tolist()
        for i, surface in enumerate(surfaces):
            # A part that is larger than a cell stays alone.
            key = (*cells[i],) if extents[i] < cell else (float(i),)
            groups.setdefault(key, []).append(surface)
        cell *= 1.5
    return list(groups.values()), cell / 1.5
