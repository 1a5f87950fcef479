"""Finds overlaps of movable bodies with the ground and each other, and lifts to clear them."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.compilation.elementary_arrays import cos_all, sin_all
from evoros.geometry.footprint import height_points
from evoros.geometry.overlap import SIDEWAYS, Clearance, Solid, clearance, overlap_depth
from evoros.geometry.polyhedron import hull_planes, placed_corners
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.floors import ground_shapes, interpolate_heights, plane_normal

SLACK_M = 0.002  # maximum overlap [m] left for engines to undo, at the speed of a 2 mm fall


@dataclass(frozen=True, eq=False)
class Solids:
    """Solid shapes with bounding boxes; arrays have one row per shape."""

    placed: tuple[tuple[Shape, Pose], ...]
    body: NDArray[np.intp]  # index of each shape's body
    low: Array  # (n, 3) [m]
    high: Array  # (n, 3) [m]
    _known: dict[int, Solid] = field(default_factory=dict)

    def __getitem__(self, shape: int) -> Solid:
        """Return a shape, placed in the world when needed, since few are near movable bodies."""
        if shape not in self._known:
            self._known[shape] = Solid.at(*self.placed[shape])
        return self._known[shape]

    @classmethod
    def of(cls, bodies: Sequence[Body]) -> "Solids":
        """Collect the shapes of bodies, except planes and height fields, which are not solid."""
        owners: list[int] = []
        placed: list[tuple[Shape, Pose]] = []
        boxes = []
        for i, body in enumerate(bodies):
            for solid, box in zip(body.placed, body.boxes, strict=True):
                if solid[0].kind not in ("plane", "heightfield"):
                    owners.append(i)
                    placed.append(solid)
                    boxes.append(box if solid[0].kind == "convex" else Solid.at(*solid).box())
        low, high = np.moveaxis(np.array(boxes).reshape(-1, 2, 3), 1, 0)
        return cls(tuple(placed), np.array(owners, dtype=np.intp), low, high)

    def list_near(self, shape: int, axes: int) -> Iterator[int]:
        """Yield shapes of other bodies whose boxes overlap a shape's box along the first axes."""
        low, high = self.low[:, :axes], self.high[:, :axes]
        near = (low < high[shape] - SLACK_M) & (high > low[shape] + SLACK_M)
        yield from np.flatnonzero(near.all(axis=1) & (self.body != self.body[shape])).tolist()


_RINGS, _SECTORS = 8, 16  # numbers of rings and sectors of directions for sampling round shapes


def find_sunk(bodies: Sequence[Body], solids: Solids) -> dict[int, float]:
    """Return the depth [m] of each sunk movable body below planes and height fields, by index."""
    depths: dict[int, float] = {}
    for shape, pose in ground_shapes(bodies):
        heights = _Field(shape, pose) if shape.kind == "heightfield" else None
        for j, i in enumerate(solids.body.tolist()):
            if bodies[i].mass is None or shape.kind not in ("plane", "heightfield"):
                continue
            solid = solids[j]
            if heights is None:
                normal = plane_normal(shape, pose)
                above = solid.farthest(-normal) - np.array(pose.position)
                depth = -float((above * normal).sum() / normal[2])
            else:
                depth = heights.depth(solid)
            depths[i] = max(depths.get(i, 0.0), depth)
    return {i: depth for i, depth in depths.items() if depth > SLACK_M}


class _Field:
    """A height field in the world, prepared once for all bodies."""

    def __init__(self, shape: Shape, pose: Pose) -> None:
        grid = height_points(shape).reshape(-1, 3)
        self._corners = placed_corners(grid, pose.rotation, pose.position)
        self._heights, self._size = np.array(shape.heights), shape.size
        self._into, self._base = pose.inverse(), pose.position[2]

    def depth(self, solid: Solid) -> float:
        """Return the lift [m] that brings all points of a solid above the field."""
        points = solid.points
        if solid.shape.kind not in ("box", "convex"):  # adds samples of a round underside
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
    """Return the height [m] of each point in a polyhedron's footprint above its underside."""
    x, y = points[:, 0], points[:, 1]
    within = np.ones(len(points), dtype=np.bool_)
    floor, roof = np.full(len(points), -np.inf), np.full(len(points), np.inf)
    for nx, ny, nz, offset in planes.tolist():
        left = offset - nx * x - ny * y
        if abs(nz) <= SIDEWAYS:
            within &= left >= 0.0
        elif nz < 0.0:
            floor = np.maximum(floor, left / nz)
        else:
            roof = np.minimum(roof, left / nz)
    heights: list[float] = (points[:, 2] - floor)[within & (floor <= roof)].tolist()
    return heights


_STEEP = 1.5  # maximum ratio of lift to shortest separation; beyond it, bodies are stacked


@dataclass(frozen=True, eq=False)
class Lifts:
    """The lifts of movable bodies by index, and their reasons."""

    heights: dict[int, float] = field(default_factory=dict)  # [m]
    depths: dict[int, float] = field(default_factory=dict)  # [m], depth in the body or ground below
    stuck: dict[int, float] = field(default_factory=dict)  # [m], depth in the ground; no room above


class _Near(NamedTuple):
    base: float  # [m], lift of the lower body
    gap: Clearance
    depth: float  # [m], depth of the overlap


def find_lifts(bodies: Sequence[Body], solids: Solids, sunk: Mapping[int, float]) -> Lifts:
    """Find lifts out of the ground (``sunk`` [m] deep) and supports, from the lowest body on."""
    shapes = {
        i: np.flatnonzero(solids.body == i).tolist()
        for i, body in enumerate(bodies)
        if body.mass is not None
    }
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
    """Yield bodies near shapes (except ``waiting``), with overlapping lifts and depth [m]."""
    for shape in shapes:
        for other in solids.list_near(shape, axes=2):
            if (body := int(solids.body[other])) in waiting:
                continue
            first, second = solids[shape], solids[other]
            gap = clearance(first, second)
            if gap is not None:
                overlap = gap.low < -SLACK_M and gap.high > SLACK_M
                yield body, gap, overlap_depth(first, second) if overlap else 0.0


def _lift(body: int, sunk: float, near: Sequence[_Near], lifts: Lifts) -> None:
    """Add the lift of a body ``sunk`` [m] deep in the ground, given the lifts of nearby bodies."""
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
