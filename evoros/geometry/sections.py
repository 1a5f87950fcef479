"""Comparison of a surface's horizontal sections with the sections of its convex parts."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from manifold3d import CrossSection, FillRule, JoinType

from evoros.base.arrays import Array
from evoros.geometry.convex_parts import make_solid
from evoros.geometry.footprint import convex_hull
from evoros.geometry.hull import THICKNESS_M
from evoros.geometry.mesh_parts import list_surfaces
from evoros.geometry.polyhedron import clip_polyhedron, convex_polyhedron
from evoros.geometry.triangles import Surface

TOLERANCE_M = 0.02
"""Distance from the surface up to which differences are ignored."""


class Sections(NamedTuple):
    """Maximum areas [m2] over all heights."""

    false: float  # inside the shapes, but outside the surface's solids and sheets
    missed: float  # the opposite
    footprint: float  # convex hull of the surface, seen from above


def compare_sections(
    surface: Surface, parts: Iterable[Array], heights: Sequence[float]
) -> Sections:
    """Compare a surface with convex parts, given by their corners (k, 3) [m]."""
    surfaces = [(part, make_solid(part)) for part in list_surfaces(surface)]
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


def _unite(areas: list[Any]) -> Any:
    return CrossSection([ring for area in areas for ring in area.to_polygons()], FillRule.NonZero)


def _grow(area: Any) -> Any:
    return area.offset(TOLERANCE_M, JoinType.Square)


def _draw(lines: Array, width: float) -> Any:
    """Return the area within a width [m] of lines (n, 2, 2), including beyond their ends."""
    along = lines[:, 1] - lines[:, 0]
    lengths = np.sqrt((along * along).sum(axis=1))
    lines, along = lines[lengths > 0.0], along[lengths > 0.0]
    along *= width / lengths[lengths > 0.0, None]
    across = along[:, ::-1] * (-1.0, 1.0)
    start, end = lines[:, 0] - along, lines[:, 1] + along
    rings = np.stack([start - across, end - across, end + across, start + across], axis=1)
    return CrossSection(list(rings), FillRule.NonZero)


def _cut(triangles: Array, height: float) -> Array:
    """Return the lines (m, 2, 2) along which triangles (n, 3, 3) cross a height [m]."""
    above = triangles[:, :, 2] > height
    crossing = triangles[above.any(axis=1) & ~above.all(axis=1)]
    above = crossing[:, :, 2] > height
    # Two edges cross: both edges of the corner that is alone on one side.
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    rows = np.arange(len(crossing))
    start = crossing[rows, alone]
    ends = [crossing[rows, (alone + step) % 3] for step in (1, 2)]
    shares = [(height - start[:, 2]) / (end[:, 2] - start[:, 2]) for end in ends]
    points = [start + (end - start) * t[:, None] for end, t in zip(ends, shares, strict=True)]
    return np.stack(points, axis=1)[:, :, :2]
