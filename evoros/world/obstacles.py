"""The obstacles of a world as arrays: what a robot can touch, and what rays can hit."""

import math
from functools import lru_cache

import numpy as np

from evoros.base.arrays import Array
from evoros.geometry.footprint import Footprint, bounding_circle, project_bodies, project_shape
from evoros.geometry.grid import Grid
from evoros.geometry.outlines import Outlines
from evoros.geometry.ray import BOX, CYLINDER, OBSTACLE_SIZE, SPHERE
from evoros.geometry.shapes import Pose, Shape
from evoros.world.model import World


@lru_cache(maxsize=64)
def outlines(world: World, below_m: float) -> Outlines:
    """The footprints of all solid shapes whose lowest point is below a height [m]."""
    return Outlines.of(project_bodies(world.obstacles, below_m))


@lru_cache(maxsize=64)
def world_arrays(world: World, height: float, touch: float, see: float) -> tuple[Array, ...]:
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
    areas = [project_shape(*placed) for placed in shapes]
    rows = [_row(*placed, area) for placed, area in zip(shapes, areas, strict=True)]
    touched, found = project_bodies(world.obstacles, height), outlines(world, height)
    grid = Grid.around(areas, max(touch, see))
    return (
        grid.to_array(),
        *grid.list_near(touched, touch),
        *grid.list_near(areas, see),
        found.rows,
        found.corners,
        np.array(rows).reshape(-1, OBSTACLE_SIZE),
    )


def _row(shape: Shape, pose: Pose, area: Footprint) -> list[float]:
    """The obstacle for ``plane.ray``."""
    kinds = {"box": BOX, "cylinder": CYLINDER, "sphere": SPHERE}
    extents = {
        "box": lambda size: [edge / 2 for edge in size],
        "cylinder": lambda size: [size[0], size[1] / 2, 0.0],
        "sphere": lambda size: [size[0], 0.0, 0.0],
    }
    x, y, circle = bounding_circle(area)
    # A circle around the centre of the shape itself: that of the footprint lies a bit beside it.
    off = math.dist((x, y), pose.position[:2])
    return [
        kinds[shape.kind],
        *pose.position,
        circle + off,
        *pose.rotation.ravel().tolist(),
        *extents[shape.kind](shape.size),
    ]
