"""The bodies of a generated field: random obstacles, and a wall around them."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.field.kinds import ObstacleKind
from evoros.field.placement import PlacedObstacles
from evoros.geometry.inertia import solid_moments
from evoros.geometry.shapes import Body, Pose, Shape

WALL_WIDTH_M, WALL_HEIGHT_M = 0.2, 1.0


def draw_obstacles(
    kinds: Mapping[str, ObstacleKind], count: int, placed: PlacedObstacles, rng: Generator
) -> Iterator[Body]:
    """Yield ``count`` obstacles among those already placed; fewer if one finds no room."""
    names = list(kinds)
    shares = np.cumsum([kind.share for kind in kinds.values()])
    for rank in range(1, count + 1):
        index = int(np.searchsorted(shares, rng.random() * shares[-1], side="right"))
        kind = kinds[names[index]]
        shape = kind.draw(rng)
        pose = placed.place(shape, rng)
        if pose is None:
            return
        inertia = None if kind.mass_kg is None else solid_moments(shape, kind.mass_kg)
        yield Body(f"{names[index]}_{rank}", pose, (shape,), kind.mass_kg, inertia=inertia)


def build_walls(low: Array, high: Array) -> tuple[Body, ...]:
    """Build four walls around a field with these opposite corners (2,) [m]."""
    (x, y), (length, width) = (low + high) / 2, high - low
    offset = WALL_WIDTH_M / 2
    along_x = Shape("box", (length + 2 * WALL_WIDTH_M, WALL_WIDTH_M, WALL_HEIGHT_M))
    along_y = Shape("box", (WALL_WIDTH_M, width, WALL_HEIGHT_M))
    walls = (
        ("south", (x, low[1] - offset), along_x),
        ("north", (x, high[1] + offset), along_x),
        ("west", (low[0] - offset, y), along_y),
        ("east", (high[0] + offset, y), along_y),
    )
    return tuple(
        Body(f"wall_{side}", Pose((*middle, WALL_HEIGHT_M / 2)), (box,))
        for side, middle, box in walls
    )
