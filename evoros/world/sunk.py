"""How deep movable bodies reach into the ground."""

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

from evoros.base.arrays import Array
from evoros.compilation.elementary_arrays import cos_all, sin_all
from evoros.geometry.footprint import height_points
from evoros.geometry.overlap import Solid
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
        field = _Field(shape, pose) if shape.kind == "heightfield" else None
        for i, solid in zip(solids.body.tolist(), solids.shapes, strict=True):
            if bodies[i].mass is None:
                continue
            if shape.kind == "plane":
                depths[i] = max(depths.get(i, 0.0), _depth_in_plane(solid, shape, pose))
            elif field is not None:
                depths[i] = max(depths.get(i, 0.0), field.depth(solid))
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
