"""Where walkers can walk in a world: free space that is connected with home, and free legs."""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.geometry.flooding import find_connected
from evoros.geometry.footprint import distances, find_bounds, project_bodies
from evoros.geometry.free_space import FreeSpace
from evoros.geometry.grid import Grid
from evoros.geometry.outlines import Outlines
from evoros.geometry.polygon import polygon_distance
from evoros.walkers.forces import FOREIGN_REACH_M
from evoros.world.model import World
from evoros.world.standing import standing_obstacles

MARGIN_M = 0.1
"""Drawn routes keep this distance from obstacles."""
AROUND_M = 2.0
"""Walkers walk at most this far outside of the obstacles and the course."""


@lru_cache(maxsize=64)
def lay_out_borders(world: World, height: float) -> tuple[Array, ...]:
    """Return the obstacles below a height [m] for the rule of walkers."""
    areas = project_bodies(standing_obstacles(world), height)
    grid, outlines = Grid.around(areas, FOREIGN_REACH_M), Outlines.of(areas)
    return grid.to_array(), *grid.list_near(areas, FOREIGN_REACH_M), outlines.rows, outlines.corners


@lru_cache(maxsize=64)
def find_free_space(world: World, radius: float, height: float) -> FreeSpace:
    """Return the places of a walker's centre that are free, and connected with home.

    Raises:
        InputError: there is no such place.
    """
    areas = project_bodies(standing_obstacles(world), height)
    course = world.course
    points = np.array([course.home[:2], *course.waypoints])
    low, high = points.min(axis=0), points.max(axis=0)
    if areas:
        bounds = find_bounds(*areas)
        low, high = np.minimum(low, bounds[0]), np.maximum(high, bounds[1])
    ground = [body for body in world.bodies if body.is_ground]
    endless = any(shape.kind == "plane" for body in ground for shape in body.shapes)
    floors = None if endless else project_bodies(ground)
    low, high = low - AROUND_M, high + AROUND_M
    space = FreeSpace.within(low, high, areas, radius + MARGIN_M, floors)
    if not space.free.any():
        raise InputError(f"has no room for a walker of radius {radius:g} m")
    centres = space.centres() - points[0]
    nearest = int((centres * centres).sum(axis=1).argmin())
    row, column = np.argwhere(space.free)[nearest].tolist()
    return FreeSpace(space.low, find_connected(space.free, (row, column)))


def find_blocking(
    world: World, corners: Sequence[Sequence[float]], radius: float, height: float
) -> tuple[str, Sequence[Sequence[float]]] | None:
    """Return the first obstacle that a leg of a closed route meets, by its name, and that leg."""
    legs = [(start, corners[(i + 1) % len(corners)]) for i, start in enumerate(corners)]
    for body in standing_obstacles(world):
        for area in project_bodies([body], height):
            reach = radius + area.radius
            for leg in legs:
                way = np.array(leg, dtype=np.float64)
                inside = distances(area, way).min() < radius
                if inside or polygon_distance(area.vertices, way, reach) < reach:
                    return body.name, leg
    return None


def measure_legs(corners: Array) -> Array:
    """Return the lengths [m] of the legs of a closed route (n, 2), the last one to its start."""
    legs = np.roll(corners, -1, axis=0) - corners
    return np.array([math.hypot(x, y) for x, y in legs.tolist()])
