"""Divides solids into convex parts by plane cuts; exact for flat faces.

MuJoCo would use the convex hull of a mesh, and PyBullet the exact mesh, but only for fixed bodies.
``manifold3d`` cuts solids and closes the cuts; ``coacd`` is hardly faster and not exact.
"""

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from manifold3d import Error, Manifold, Mesh64

from evoros.base.arrays import Array, product
from evoros.geometry.hull import make_hull
from evoros.geometry.triangles import Surface, find_normals, separate

Plane = tuple[Array, float]  # unit normal (3,), and offset [m] from the origin along it
TOLERANCE_M = 0.02  # maximum deviation from the surface that is ignored
_SUSPECTS = 64  # maximum number of faces examined in concave regions
_FINE = 300  # number of faces above which fewer cuts are tried
_CUT_WORK = 200  # number of faces whose processing takes as long as the fixed work of a cut
_GOOD = 0.95  # relative volume of the pieces' hulls below which a cut along a face is good
_ROUNDING = 1e-5  # relative difference in volume that may be due to rounding
_SLIVER_M = 1e-5  # mean thickness [m] of parts that only rounding errors separate


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a solid and its convex hull."""

    solid: Any  # manifold3d.Manifold
    hull: Any

    @property
    def concavity(self) -> float:
        """The edge [m] of a cube with the volume between the hull and the solid."""
        lacking = self.hull.volume() - self.solid.volume()
        return float(np.cbrt(lacking)) if lacking > _ROUNDING * self.hull.volume() else 0.0

    @property
    def points(self) -> Array:
        """The corners (k, 3) [m] of the solid."""
        return np.asarray(self.solid.to_mesh64().vert_properties[:, :3], dtype=np.float64)


def make_solid(surface: Surface) -> Any:
    """Return the inside of an oriented surface as a manifold3d solid; None if it is not closed."""
    if surface.volume < 0.0:
        surface = replace(surface, faces=surface.faces[:, ::-1])
    closed = separate(surface)
    if closed is None:
        return None
    faces = np.ascontiguousarray(closed.faces, dtype=np.uint64)
    solid = Manifold(Mesh64(np.ascontiguousarray(closed.points), faces))
    same = abs(solid.volume() - surface.volume) <= _ROUNDING * surface.volume
    return solid if solid.status() == Error.NoError and same else None


def divide(
    solid: Any, tolerance: float, few: int, most: int, work: float
) -> tuple[list[Piece], float, bool]:
    """Cut a solid, the most concave piece first, until concavities [m] are within the tolerance.

    The number of pieces is at most ``few`` if this leaves no concavity above ``TOLERANCE_M``,
    otherwise ``most``. Also return the faces examined, and True if ``work`` cut this short.
    """
    done: list[Piece] = []
    waiting = [(-piece.concavity, i, piece) for i, piece in enumerate(_split(solid))]
    heapq.heapify(waiting)
    serial, spent, is_cut_short = len(waiting), 0.0, False
    while waiting:
        concavity, _, worst = heapq.heappop(waiting)
        pieces: list[Piece] = []
        each = worst.solid.num_tri() + _CUT_WORK
        limit = most if -concavity > TOLERANCE_M else few
        if -concavity > tolerance and len(done) + len(waiting) + 1 < limit:
            is_cut_short |= spent + each > work
            if not is_cut_short:
                pieces, tried = _cut(worst)
                spent += tried * each
        if not pieces:
            done.append(worst)
        for piece in pieces:
            serial += 1
            heapq.heappush(waiting, (-piece.concavity, serial, piece))
    return _merge(done), spent, is_cut_short


def _split(*solids: Any) -> list[Piece]:
    """Return the connected parts of solids; a solid with a cavity is not split."""
    parts: list[Any] = []
    for solid in solids:
        pieces = solid.decompose()
        is_hollow = any(piece.volume() < 0.0 for piece in pieces)
        parts += [solid] if is_hollow else pieces
    return [
        Piece(part, part.hull())
        for part in parts
        if part.volume() > _SLIVER_M * part.surface_area()
    ]


def _cut(piece: Piece) -> tuple[list[Piece], int]:
    """Cut a piece by the plane that leaves the smallest hulls, if there is one; count planes."""
    corners, outer = _find_hollows(piece)
    tried = 8 if piece.solid.num_tri() <= _FINE else 3
    along = list(_along_faces(corners, outer, 2 * tried))
    score, pieces = _try_planes(piece, along)
    if score > _GOOD:
        across = list(_along_axes(corners, outer, tried))
        other, others = _try_planes(piece, across)
        return (others if other < score else pieces), len(along) + len(across)
    return pieces, len(along)


def _try_planes(piece: Piece, planes: list[Plane]) -> tuple[float, list[Piece]]:
    """Return the smallest total volume of hulls, relative to the piece's hull, and the pieces."""
    best, chosen = (np.inf, 0), []
    for normal, offset in planes:
        pieces = _split(*piece.solid.split_by_plane(normal, offset))
        share = sum(part.hull.volume() for part in pieces) / piece.hull.volume()
        score = (round(share, 6), len(pieces))
        # A cut that removes only a thin rounding layer leaves a single piece.
        if (len(pieces) > 1 or (pieces and share < 0.999)) and score < best:
            best, chosen = score, pieces
    return best[0], chosen


def _merge(pieces: list[Piece]) -> list[Piece]:
    """Merge pieces separated by the cut of another piece if their union is convex."""
    waiting, done = list(pieces), []
    while waiting:
        piece = waiting.pop(0)
        for index, other in enumerate(waiting):
            union = _unite(piece, other)
            if union is not None:
                waiting[index] = union
                break
        else:
            done.append(piece)
    return done


def _unite(first: Piece, second: Piece) -> Piece | None:
    a, b = np.reshape(first.hull.bounding_box(), (2, 3)), second.hull.bounding_box()
    c, d = np.reshape(b, (2, 3))
    if (a[0] > d + 1e-6).any() or (c > a[1] + 1e-6).any():
        return None
    hull = Manifold.batch_hull([first.hull, second.hull])
    volume = first.hull.volume() + second.hull.volume()
    if abs(hull.volume() - volume) > 1e-4 * volume:
        return None
    return Piece(first.solid + second.solid, hull)


def _find_hollows(piece: Piece) -> tuple[Array, Array]:
    """Return the triangles (n, 3, 3) deepest inside a piece's hull, and the hull's corners."""
    mesh, hull = piece.solid.to_mesh64(), make_hull(piece.points)
    if hull is None:
        return np.empty((0, 3, 3)), np.empty((0, 3))
    corners = piece.points[np.asarray(mesh.tri_verts, dtype=np.int64)]
    depths = hull.depth(corners.mean(axis=1))
    deepest = np.argsort(-np.round(depths, 6), kind="stable")[:_SUSPECTS]
    return corners[deepest[depths[deepest] > 1e-6]], hull.corners


def _along_faces(corners: Array, outer: Array, most: int) -> Iterator[Plane]:
    """Yield up to ``most`` distinct planes of triangles that have outer points on both sides."""
    if not len(corners):
        return
    normals = find_normals(corners)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    normals *= np.sign(np.take_along_axis(normals, np.abs(normals).argmax(axis=1)[:, None], 1))
    offsets = (corners[:, 0] * normals).sum(axis=1)
    sides = product(normals, outer.T) - offsets[:, None]
    cutting = (sides.min(axis=1) < -1e-6) & (sides.max(axis=1) > 1e-6)
    _, first = np.unique(np.round(np.c_[normals, offsets], 6), axis=0, return_index=True)
    for i in np.intersect1d(first, np.flatnonzero(cutting))[:most].tolist():
        yield normals[i], float(offsets[i])


def _along_axes(corners: Array, outer: Array, most: int) -> Iterator[Plane]:
    """Yield up to ``most`` planes per axis, normal to the axis, through corners of triangles."""
    low, high = outer.min(axis=0) + 1e-6, outer.max(axis=0) - 1e-6
    for axis in range(3) if len(corners) else ():
        levels = np.unique(corners[: 2 * most, :, axis].round(7))
        levels = levels[(levels > low[axis]) & (levels < high[axis])]
        chosen = np.unique(np.linspace(0, len(levels) - 1, most).round().astype(int))
        for level in levels[chosen] if len(levels) else ():
            yield np.eye(3)[axis], float(level)
