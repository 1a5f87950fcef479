"""Divides any surface into convex parts: close hulls, pieces of solids, or plates for sheets."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from manifold3d import CrossSection, FillRule, JoinType, Manifold

from evoros.base.arrays import Array
from evoros.geometry.convex_parts import TOLERANCE_M, divide, make_solid
from evoros.geometry.footprint import convex_hull
from evoros.geometry.hull import THICKNESS_M, Hull, is_hull, make_hull, simplify
from evoros.geometry.polyhedron import clip_polyhedron, convex_polyhedron, divide_into_polygons
from evoros.geometry.triangles import (
    Surface,
    concatenate,
    is_closed,
    join_near,
    orient,
    split_by_edges,
    weld,
)


class Sections(NamedTuple):
    """Areas [m2] of horizontal sections of a surface and its parts, maximized over all heights."""

    false: float  # inside the parts, but outside the solids and sheets of the surface
    missed: float  # inside the solids and sheets of the surface, but outside the parts
    footprint: float  # convex hull of the surface in top view


def compare_sections(
    surface: Surface, parts: Iterable[Array], heights: Sequence[float]
) -> Sections:
    """Compare a surface with convex parts, each given by its corners (k, 3) [m]."""
    surfaces = [
        (part, _fill(part))
        for part in list_surfaces(surface)
        if part.points[:, 2].min() < max(heights) and part.points[:, 2].max() > min(heights)
    ]
    polyhedra = [convex_polyhedron(tuple(map(tuple, corners.tolist()))) for corners in parts]
    false = missed = 0.0
    for height in heights:
        solids = [solid.slice(height) for _, solid in surfaces if solid is not None]
        sheets = [_cut(part.triangles, height) for part, solid in surfaces if solid is None]
        lines = np.concatenate([np.empty((0, 2, 2)), *sheets])
        rings = [
            convex_hull(points[:, :2])
            for corners, _, edges, _ in polyhedra
            if len(points := clip_polyhedron(corners, edges, height, height)) > 2
        ]
        taken = CrossSection([ring for ring in rings if len(ring) > 2], FillRule.NonZero)
        outside = taken - _grow(_unite(solids)) - _draw(lines, TOLERANCE_M)
        lost = _unite([*solids, _draw(lines, THICKNESS_M / 2)]) - _grow(taken)
        false, missed = max(false, outside.area()), max(missed, lost.area())
    return Sections(false, missed, CrossSection.hull_points(surface.points[:, :2]).area())


def _fill(surface: Surface) -> Any:
    """Return the solid inside a surface, even if its bottom is open; None if there is none."""
    solid = make_solid(surface)
    hull = make_hull(surface.points) if solid is None else None
    if hull is not None and _fills_hull(surface, None, hull):
        return Manifold.hull_points(surface.points)
    return solid


def _fills_hull(surface: Surface, solid: Any, hull: Hull) -> bool:
    extent = float(np.ptp(hull.corners, axis=0).max())
    is_full = solid is None or solid.volume() > _FULL * hull.volume
    fits = min(max(0.002, 0.01 * extent), 0.02)
    return is_full and not surface.is_hollow and is_hull(surface, hull, fits)


def _unite(areas: list[Any]) -> Any:
    return CrossSection([ring for area in areas for ring in area.to_polygons()], FillRule.NonZero)


def _grow(area: Any) -> Any:
    return area.offset(TOLERANCE_M, JoinType.Square)


def _draw(lines: Array, width: float) -> Any:
    """Return the area within ``width`` [m] of line segments (n, 2, 2), also beyond their ends."""
    along = lines[:, 1] - lines[:, 0]
    lengths = np.sqrt((along * along).sum(axis=1))
    lines, along = lines[lengths > 0.0], along[lengths > 0.0]
    along *= width / lengths[lengths > 0.0, None]
    across = along[:, ::-1] * (-1.0, 1.0)
    start, end = lines[:, 0] - along, lines[:, 1] + along
    rings = np.stack([start - across, end - across, end + across, start + across], axis=1)
    return CrossSection(list(rings), FillRule.NonZero)


def _cut(triangles: Array, height: float) -> Array:
    """Return the line segments (m, 2, 2) in which triangles (n, 3, 3) cross a height [m]."""
    above = triangles[:, :, 2] > height
    crossing = triangles[above.any(axis=1) & ~above.all(axis=1)]
    above = crossing[:, :, 2] > height
    # Both crossing edges belong to the corner that is alone on its side.
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    rows = np.arange(len(crossing))
    start = crossing[rows, alone]
    ends = [crossing[rows, (alone + step) % 3] for step in (1, 2)]
    shares = [(height - start[:, 2]) / (end[:, 2] - start[:, 2]) for end in ends]
    points = [start + (end - start) * t[:, None] for end, t in zip(ends, shares, strict=True)]
    return np.stack(points, axis=1)[:, :, :2]


@dataclass(frozen=True)
class _Limits:
    surfaces: int  # maximum number of connected parts before small neighbours are joined
    plates: int  # number of further plates, shared among the surfaces by area
    parts: int  # maximum number of parts of one solid


def _limit_pieces(most: int, extent: float) -> int:
    """Return the maximum number of pieces, at most ``most``, of a surface with an extent [m]."""
    return min(most, max(_FEWEST, math.ceil(2 * extent / TOLERANCE_M)))


_FEWEST = 12  # lower bound of the limits on surfaces, and on pieces of a surface
_PLATES = 128  # maximum number of plates of a surface with a small share of the area
_SMALL, _LARGE = _Limits(256, 0, 64), _Limits(2048, 4096, 256)
_LARGE_M = 5.0  # extent [m] from which a mesh is a building or a landscape
_MOST_FACES = 2000  # maximum number of faces of a solid to cut; finer solids are coarsened
_FULL = 0.9  # minimum fraction of the hull that a solid fills to be replaced with the hull
_READ, _MERGE, _HULL, _PART, _USE = 4, 10, 400, 400, 120
"""Work per face read, face merged, hull, part and use, in faces examined by cuts (5 us each)."""
_USES_SHARE = 0.25  # maximum fraction of a mesh's work for its further uses


@dataclass(frozen=True, eq=False)
class Parts:
    """Convex parts that represent a surface."""

    hulls: tuple[Hull, ...]
    dropped: int  # number of parts omitted because they are too small
    deviation: float  # maximum distance [m] from the surface to the surfaces of the parts
    work: float  # number of faces examined in cuts, or equivalent work; includes reading the mesh
    is_cut_short: bool  # whether more work would give better parts


def divide_mesh(triangles: Array, work: float = math.inf, uses: int = 1) -> Parts:
    """Divide triangles (n, 3, 3) [m] into convex parts, with at most about ``work`` operations.

    A world processes all parts again for each of the ``uses`` of the mesh.
    """
    surface, spent = weld(triangles), float(_READ * len(triangles))
    limits = _LARGE if np.ptp(surface.points, axis=0).max() >= _LARGE_M else _SMALL
    again = (uses - 1) * _USE
    parts = max(_FEWEST, _USES_SHARE * work / again) if again else math.inf
    most = int(min(limits.surfaces, max(_FEWEST, (work - spent) / (_HULL + _PART)), parts / 2))
    surfaces = list_surfaces(surface)
    groups, deviation = _gather(surfaces, most)
    if again:  # ground robots collide with the lowest surfaces, such as trunks below leaves
        groups.sort(key=lambda group: min(float(part.points[:, 2].min()) for part in group))
    spent += len(groups) * (_HULL + _PART)
    divider = _Divider(limits, surface.area, work, spent, parts - len(groups))
    divider.is_cut_short = most < min(limits.surfaces, len(surfaces))
    hulls: list[Hull] = []
    dropped = 0
    for group in groups:
        pieces, error = divider.divide(group)
        dropped += not pieces
        deviation = max(deviation, error)
        for hull in pieces:
            simple, error = simplify(hull)
            hulls.append(simple)
            deviation = max(deviation, error)
    spent = divider.work + again * len(hulls)
    return Parts(tuple(hulls), dropped, deviation, spent, divider.is_cut_short)


class _Divider:
    """Divides surfaces of a total ``area`` [m2] with a limited amount of work."""

    def __init__(
        self, limits: _Limits, area: float, limit: float, work: float, spare: float
    ) -> None:
        self._limits = limits
        self._area = area
        self._limit = limit
        self._spare = spare  # number of parts available beyond one per surface
        self.work = work
        self.is_cut_short = False

    def divide(self, group: list[Surface]) -> tuple[list[Hull], float]:
        """Return the hulls of surfaces that are treated as one, and their maximum deviation [m]."""
        surface = group[0]
        hull = make_hull(np.concatenate([part.points for part in group]))
        if hull is None:
            return [], 0.0
        extent = float(np.ptp(hull.corners, axis=0).max())
        if len(group) > 1:
            return [hull], 0.0
        solid = make_solid(surface)
        if _fills_hull(surface, solid, hull):
            return [hull], 0.0
        hulls: list[Hull] = []
        error, tolerance = extent, min(max(0.01, 0.03 * extent), 0.1)
        if solid is not None and self.work < self._limit:
            hulls, error = self._cut(solid, extent, tolerance)
        self.is_cut_short |= error > tolerance and self.work >= self._limit
        if error > tolerance and self.work < self._limit:
            plates, moved = self._make_plates(surface, extent)
            hulls, error = (plates, moved) if plates and moved < error else (hulls, error)
        self.work += _PART * max(len(hulls) - 1, 0)
        self._spare = max(0.0, self._spare - max(len(hulls) - 1, 0))
        return (hulls, error) if hulls else ([hull], float(np.cbrt(hull.volume)))

    def _cut(self, solid: Any, extent: float, tolerance: float) -> tuple[list[Hull], float]:
        cell, error = min(max(extent / 100, 0.002), 0.02), 0.0
        while solid.num_tri() > _MOST_FACES and error < extent:
            error = cell
            solid, cell = solid.simplify(cell), 1.5 * cell
        allowed = (self._limit - self.work) / 2  # half of the rest is for other surfaces
        most = int(min(self._limits.parts, 1 + self._spare))
        few = _limit_pieces(most, extent)
        pieces, work, is_cut_short = divide(solid, tolerance, few, most, allowed)
        self.work += work
        self.is_cut_short |= is_cut_short or most <= len(pieces) < self._limits.parts
        hulls = [hull for piece in pieces if (hull := make_hull(piece.points)) is not None]
        return hulls, error + max((piece.concavity for piece in pieces), default=extent)

    def _make_plates(self, surface: Surface, extent: float) -> tuple[list[Hull], float]:
        """Return the hulls of a surface's flat polygons, and their maximum deviation [m]."""
        share = int(self._limits.plates * surface.area / self._area)
        wanted = max(_PLATES, share)
        most = min(wanted, 1 + self._spare)
        few = min(most, max(_limit_pieces(_PLATES, extent), share))
        most_faces = min(8 * most, (self._limit - self.work) / _MERGE)
        coarse, error, cell = surface, 0.0, min(max(extent / 200, 0.002), 0.1)
        reach = float(np.abs(surface.points).max())  # larger cells would merge the same points
        polygons: list[Array] = []
        while True:
            joined, kept, moved = join_near(surface, cell)
            if len(coarse.faces) <= most_faces:
                polygons = divide_into_polygons(coarse)
                self.work += _MERGE * len(coarse.faces)
                if len(polygons) <= (few if moved <= TOLERANCE_M else most):
                    break
            if not len(kept) or cell > 1.5 * reach:
                break
            coarse, error, cell = joined, moved, 1.5 * cell
        self.is_cut_short |= error > 0.0 and most_faces < 8 * wanted
        return [hull for points in polygons if (hull := make_hull(points)) is not None], error


def list_surfaces(surface: Surface) -> list[Surface]:
    """List the connected parts; a closed part around a cavity is joined with the part around it."""
    surfaces = [orient(part) for part in split_by_edges(surface)]
    volumes = [surface.volume if is_closed(surface) else 0.0 for surface in surfaces]
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


def _gather(surfaces: list[Surface], most: int) -> tuple[list[list[Surface]], float]:
    """Group small neighbours into at most ``most`` groups; also return the groups' width [m]."""
    if len(surfaces) <= most:
        return [[surface] for surface in surfaces], 0.0
    low = np.array([surface.points.min(axis=0) for surface in surfaces])
    high = np.array([surface.points.max(axis=0) for surface in surfaces])
    extents = (high - low).max(axis=1)
    cell = float((high.max(axis=0) - low.min(axis=0)).max()) / 200
    groups: dict[tuple[float, ...], list[Surface]] = {}
    while len(groups) == 0 or len(groups) > most:
        groups = {}
        cells = np.floor((low + high) / 2 / cell).tolist()
        for i, surface in enumerate(surfaces):
            # A part larger than a cell forms its group alone.
            key = (*cells[i],) if extents[i] < cell else (float(i),)
            groups.setdefault(key, []).append(surface)
        cell *= 1.5
    return list(groups.values()), cell / 1.5
