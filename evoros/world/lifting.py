"""How deep movable bodies reach into the ground, and how far they must be lifted to stand."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np

from evoros.base.arrays import Array
from evoros.compilation.elementary_arrays import cos_all, sin_all
from evoros.geometry.footprint import height_points
from evoros.geometry.overlap import Clearance, Solid, clearance, overlap_depth
from evoros.geometry.polyhedron import hull_planes, placed_corners
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.floors import ground_shapes, interpolate_heights, plane_normal
from evoros.world.solids import SLACK_M, Solids

_SIDEWAYS = 1e-9  # a face whose unit normal rises by less is vertical

_RINGS, _SECTORS = 8, 16  # of directions in which points of a round shape are looked up


def find_sunk(bodies: Sequence[Body], solids: Solids) -> dict[int, float]:
    """Return the depths [m] of movable bodies that reach below planes and height fields."""
    depths: dict[int, float] = {}
    for shape, pose in ground_shapes(bodies):
        heights = _Field(shape, pose) if shape.kind == "heightfield" else None
        for i, solid in zip(solids.body.tolist(), solids.shapes, strict=True):
            if bodies[i].mass is None:
                continue
            if shape.kind == "plane":
                depths[i] = max(depths.get(i, 0.0), _depth_in_plane(solid, shape, pose))
            elif heights is not None:
                depths[i] = max(depths.get(i, 0.0), heights.depth(solid))
    return {i: depth for i, depth in depths.items() if depth > SLACK_M}


def _depth_in_plane(solid: Solid, shape: Shape, pose: Pose) -> float:
    normal = plane_normal(shape, pose)
    above = solid.farthest(-normal) - np.array(pose.position)
    return -float((above * normal).sum() / normal[2])


class _Field:
    """A height field, whose points are placed once for all bodies."""

    def __init__(self, shape: Shape, pose: Pose) -> None:
        grid = height_points(shape).reshape(-1, 3)
        self._corners = placed_corners(grid, pose.rotation, pose.position)
        self._heights, self._size = np.array(shape.heights), shape.size
        self._into, self._base = pose.inverse(), pose.position[2]

    def depth(self, solid: Solid) -> float:
        """Return how far [m] the solid must be lifted, so that no point of it is below the field.

        The points are corners of the solid, and the points of the field that are below or in it.
        """
        points = solid.points
        if solid.shape.kind not in ("box", "convex"):  # enough to tell the underside of a round one
            points = np.concatenate([points, *(solid.farthest(d)[None] for d in _directions())])
        depths = [0.0]
        for x, y, z in points.tolist():
            inside = self._into.transform((x, y, 0.0))
            height = interpolate_heights(self._heights, self._size, inside[0], inside[1])
            if height is not None:
                depths.append(self._base + height - z)
        low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        near = ((self._corners[:, :2] >= low) & (self._corners[:, :2] <= high)).all(axis=1)
        if near.any():
            depths += _heights_above(self._corners[near], hull_planes(points)[0])
        return max(depths)


@cache
def _directions() -> Array:
    tilts = np.arange(1, _RINGS) * (math.pi / _RINGS)
    turns = np.arange(_SECTORS) * (2 * math.pi / _SECTORS)
    tilt, turn = (angles.ravel() for angles in np.meshgrid(tilts, turns))
    across = sin_all(tilt)
    return np.column_stack([across * cos_all(turn), across * sin_all(turn), cos_all(tilt)])


def _heights_above(points: Array, planes: Array) -> list[float]:
    """Return the heights [m] of points above the underside of a polyhedron right above or below."""
    x, y = points[:, 0], points[:, 1]
    within = np.ones(len(points), dtype=np.bool_)
    floor, roof = np.full(len(points), -np.inf), np.full(len(points), np.inf)
    for nx, ny, nz, offset in planes.tolist():
        left = offset - nx * x - ny * y
        if abs(nz) <= _SIDEWAYS:
            within &= left >= 0.0
        elif nz < 0.0:
            floor = np.maximum(floor, left / nz)
        else:
            roof = np.minimum(roof, left / nz)
    heights: list[float] = (points[:, 2] - floor)[within & (floor <= roof)].tolist()
    return heights


_STEEP = 1.5
"""A body is lifted out of another one if this is at most so many times the shortest way out. What
overlaps at the side would end on top of the other."""


@dataclass(frozen=True, eq=False)
class Lifts:
    """The lifts of movable bodies by their number, and what led to them."""

    heights: dict[int, float] = field(default_factory=dict)  # [m]
    depths: dict[int, float] = field(default_factory=dict)  # [m] in what is below them
    stuck: dict[int, float] = field(default_factory=dict)  # [m] in the ground, without room above


class _Near(NamedTuple):
    """A body above, below or in another one."""

    base: float  # its lift [m]
    gap: Clearance
    depth: float  # [m], of the overlap


def find_lifts(bodies: Sequence[Body], solids: Solids, sunk: Mapping[int, float]) -> Lifts:
    """Find the lifts of movable bodies, from the lowest to the highest.

    A body is lifted out of the ground and out of what carries it, with the bodies that stand on
    it. It is not lifted into a body above it, unless that body moves up as well. ``sunk`` has the
    depths [m] of bodies in the ground.
    """
    shapes = {i: solids.shapes_of(i) for i, body in enumerate(bodies) if body.mass is not None}
    lowest = {i: float(solids.low[rows, 2].min()) for i, rows in shapes.items()}
    lifts, waiting = Lifts(), set(shapes)
    for i in sorted(shapes, key=lambda i: (lowest[i], i)):
        waiting.remove(i)
        near = [
            _Near(lifts.heights.get(other, 0.0), gap, depth)
            for other, gap, depth in _list_near(shapes[i], solids, waiting)
        ]
        _lift(i, sunk.get(i, 0.0), near, lifts)
    return lifts


def _list_near(
    shapes: Sequence[int], solids: Solids, waiting: Collection[int]
) -> Iterator[tuple[int, Clearance, float]]:
    """Yield the bodies above, below or in the shapes of a body, but for those ``waiting``.

    Each comes with the lifts at which the shapes overlap, and the depth [m] at which they do now.
    """
    for shape in shapes:
        for other in solids.list_near(shape, axes=2):
            if (body := int(solids.body[other])) in waiting:
                continue
            first, second = solids.shapes[shape], solids.shapes[other]
            gap = clearance(first, second)
            if gap is not None:
                overlap = gap.low < -SLACK_M and gap.high > SLACK_M
                yield body, gap, overlap_depth(first, second) if overlap else 0.0


def _lift(body: int, sunk: float, near: Sequence[_Near], lifts: Lifts) -> None:
    """Add the lift of a body, ``sunk`` [m] in the ground, to the lifts of the bodies around it."""
    deepest = need = sunk
    ceiling = math.inf
    for base, gap, depth in near:
        if depth > SLACK_M:
            if gap.high <= _STEEP * depth:
                need, deepest = max(need, base + gap.high), max(deepest, gap.high)
        elif base and gap.high <= SLACK_M:
            need = max(need, base + gap.high)
        elif gap.low >= -SLACK_M:
            ceiling = min(ceiling, base + gap.low)
    if need > ceiling + SLACK_M:
        if sunk:
            lifts.stuck[body] = sunk
    elif need > 0.0:
        lifts.heights[body] = need
        if deepest:
            lifts.depths[body] = deepest
