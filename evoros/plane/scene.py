"""A world as arrays: what rays can meet, what a robot can touch, and where both are."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from evoros.body import Pose, Shape
from evoros.geometry import Footprint, footprint, footprints
from evoros.plane.index import Grid
from evoros.plane.ray import BOX, CYLINDER, OBSTACLE_SIZE, SPHERE
from evoros.types import Array
from evoros.world import World

# One footprint: a row of FOOTPRINT_SIZE values; its corners are elsewhere.
CENTRE_X, CENTRE_Y, CIRCLE, ROUND, FIRST, BEHIND = range(6)
"""Centre and radius [m] of a circle around it, how far it reaches beyond its polygon [m], its
first corner, and the one behind its last."""
FOOTPRINT_SIZE = 6


@dataclass(frozen=True, eq=False)
class Outlines:
    """Footprints of obstacles, in arrays."""

    rows: Array  # (n, FOOTPRINT_SIZE)
    corners: Array  # (m, 2) [m], of all

    @classmethod
    def of(cls, areas: Sequence[Footprint]) -> "Outlines":
        """``areas`` in their order."""
        rows, first = np.empty((len(areas), FOOTPRINT_SIZE)), 0
        for row, area in zip(rows, areas, strict=True):
            x, y, circle = _disc(area)
            row[:] = x, y, circle, area.radius, first, first + len(area.vertices)
            first += len(area.vertices)
        corners = [area.vertices for area in areas]
        return cls(rows, np.concatenate(corners) if corners else np.zeros((0, 2)))


@lru_cache(maxsize=64)
def outlines(world: World, below_m: float) -> Outlines:
    """The footprints of all solid shapes whose lowest point is below a height [m]."""
    return Outlines.of(footprints(world.obstacles, below_m))


@lru_cache(maxsize=64)
def scene(world: World, height: float, touch: float, see: float) -> tuple[Array, ...]:
    """What a robot of some height [m] can meet in a world: see the names in ``simulator.planar``.

    ``touch`` and ``see`` [m] are how far it can touch and see from the origin of its frame.
    Returns the grid, starts and entries of what it can touch, then of what it can see; the rows
    and corners of ``outlines``; the rows of what rays can meet.
    """
    shapes = [
        (shape, body.pose @ shape.pose)
        for body in world.obstacles
        for shape in body.shapes
        if shape.kind != "plane"
    ]
    areas = [footprint(*placed) for placed in shapes]
    rows = [_row(*placed, area) for placed, area in zip(shapes, areas, strict=True)]
    touched, found = footprints(world.obstacles, height), outlines(world, height)
    grid = Grid.around(areas, max(touch, see))
    return (
        grid.flat(),
        *grid.lists(touched, touch),
        *grid.lists(areas, see),
        found.rows,
        found.corners,
        np.array(rows).reshape(-1, OBSTACLE_SIZE),
    )


def _disc(area: Footprint) -> tuple[float, float, float]:
    """Centre and radius of a circle around a footprint."""
    x, y = ((area.vertices.min(axis=0) + area.vertices.max(axis=0)) / 2).tolist()
    reach = np.sqrt(((area.vertices - (x, y)) ** 2).sum(axis=1)).max()
    return x, y, float(reach) + area.radius


def _row(shape: Shape, pose: Pose, area: Footprint) -> list[float]:
    """The obstacle for ``plane.ray``."""
    kinds = {"box": BOX, "cylinder": CYLINDER, "sphere": SPHERE}
    extents = {
        "box": lambda size: [edge / 2 for edge in size],
        "cylinder": lambda size: [size[0], size[1] / 2, 0.0],
        "sphere": lambda size: [size[0], 0.0, 0.0],
    }
    x, y, circle = _disc(area)
    # A circle around the centre of the shape itself: that of the footprint lies a bit beside it.
    off = math.dist((x, y), pose.position[:2])
    return [
        kinds[shape.kind],
        *pose.position,
        circle + off,
        *pose.rotation.ravel().tolist(),
        *extents[shape.kind](shape.size),
    ]
