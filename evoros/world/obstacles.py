"""The obstacles of a world as arrays, for contact and for ray casting."""

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
    """Return the footprints of all solid shapes whose lowest point is below a height [m]."""
    return Outlines.of(project_bodies(world.obstacles, below_m))


@lru_cache(maxsize=64)
def world_arrays(world: World, height: float, touch: float, see: float) -> tuple[Array, ...]:
    """Return the obstacles of a world for a robot of some height [m].

    ``touch`` and ``see`` [m] are the distances from the origin of its frame up to which the robot
    can touch and see.

    Returns:
        The grid (see ``evoros.geometry.grid``); the starts and entries of the cells for contact,
        then those for sight; the rows and corners of ``outlines``; the rows of all obstacles for
        rays (see ``evoros.geometry.ray``).
    """
    placed = [
        (shape, body.pose @ shape.pose)
        for body in world.obstacles
        for shape in body.shapes
        if shape.kind != "plane"
    ]
    visible = [project_shape(shape, pose) for shape, pose in placed]
    rows = [_to_row(*solid, area) for solid, area in zip(placed, visible, strict=True)]
    touchable, areas = project_bodies(world.obstacles, height), outlines(world, height)
    grid = Grid.around(visible, max(touch, see))
    return (
        grid.to_array(),
        *grid.list_near(touchable, touch),
        *grid.list_near(visible, see),
        areas.rows,
        areas.corners,
        np.array(rows).reshape(-1, OBSTACLE_SIZE),
    )


def _to_row(shape: Shape, pose: Pose, footprint: Footprint) -> list[float]:
    """Return the row of an obstacle for ``evoros.geometry.ray``."""
    kinds = {"box": BOX, "cylinder": CYLINDER, "sphere": SPHERE}
    extents = {
        "box": lambda size: [edge / 2 for edge in size],
        "cylinder": lambda size: [size[0], size[1] / 2, 0.0],
        "sphere": lambda size: [size[0], 0.0, 0.0],
    }
    x, y, radius = bounding_circle(footprint)
    # Rays need a circle around the centre of the shape, which may lie beside that of the footprint.
    offset = math.dist((x, y), pose.position[:2])
    return [
        kinds[shape.kind],
        *pose.position,
        radius + offset,
        *pose.rotation.ravel().tolist(),
        *extents[shape.kind](shape.size),
    ]
