"""Worlds drawn as those of BARN: a field of cylinders by a cellular automaton, with a way through.

``evoros.field.barn_grid`` has the procedure and its source.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Annotated, ClassVar

import numpy as np

from evoros.base.checks import COUNT, PROBABILITY, SEED, checked, invalid, sequence_of
from evoros.base.rng import generator
from evoros.field.barn_grid import (
    CELL_M,
    SIDE,
    Cells,
    draw_grids,
    find_free,
    find_shortest,
    has_corridor,
    locate,
    measure_way,
)
from evoros.field.drawn import draw_example, note_draws
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.course import A_COURSE, Course
from evoros.world.floors import GROUND
from evoros.world.model import KEPT_WORLDS, World

WORLD_NAME = "barn"
RADIUS_M, HEIGHT_M = 0.075, 1.0
"""Of each cylinder."""
WALL_COLUMNS = 34
"""Cells of the walls on both sides of the start, along the way, before the first column."""
BATCH, MAX_BATCHES = 32, 2000
"""Grids that are drawn at once, and how often, until one has a corridor."""


@dataclass(frozen=True)
@checked
class BarnField:
    """A distribution of BARN worlds.

    Each has one of the pairs of ``fill`` and ``smoothings``; grids without a corridor are drawn
    again. ``seed`` and the key of the random draws determine the world.
    """

    course: Annotated[Course, A_COURSE]
    fill: Annotated[Sequence[float], sequence_of(float, "shares")]  # of filled cells, to begin with
    smoothings: Annotated[Sequence[int], sequence_of(int, "whole numbers")]
    seed: Annotated[int, SEED] = 0

    kind: ClassVar[str] = "field"

    def __post_init__(self) -> None:
        for name, rule in (("fill", PROBABILITY), ("smoothings", COUNT)):
            values = tuple(getattr(self, name))
            if not values or not all(map(rule.holds, values)):
                raise invalid(self, name, list(values), f"must be a list, each {rule.text}")
            object.__setattr__(self, name, values)  # a key of a cache

    def draw_world(self, draws: str) -> World:
        """Draw the world under this key of random draws, once in a process."""
        return _draw_world(self, draws)

    def draw_grid(self, draws: str) -> Cells:
        """Draw the cells that have a cylinder.

        Raises:
            InputError: no grid has a corridor.
        """
        rng = generator(draws, f"barn {self.seed}")
        pairs = list(product(self.fill, self.smoothings))
        fill, smoothings = pairs[int(rng.integers(len(pairs)))]
        for _ in range(MAX_BATCHES):
            grids = draw_grids(BATCH, fill, smoothings, rng)
            for index, free in enumerate(find_free(grids)):
                if has_corridor(free):
                    return np.asarray(grids[index], dtype=np.bool_)
        rule = f"must leave a corridor, but {MAX_BATCHES * BATCH} grids of {fill:g} have none"
        raise invalid(self, "fill", list(self.fill), rule, "lower it")

    def measure_shortest(self, cells: Cells) -> float:
        """Return the length [m] of the shortest way from home to the last waypoint."""
        home, goal = self.course.home[:2], self.course.waypoints[-1]
        return measure_way(find_shortest(find_free(cells), home, (goal[0], goal[1])))


def generate_barn(
    course: Course,
    fill: Sequence[float],
    smoothings: Sequence[int],
    seed: int = 0,
    renew: bool = True,
) -> World:
    """Draw a world as those of BARN; with ``renew``, each mission has one of its own.

    Raises:
        InputError: a value is out of range.
    """
    field = BarnField(course, fill, smoothings, seed)
    return draw_example(field, renew, "generate_barn")


@lru_cache(maxsize=KEPT_WORLDS)
def _draw_world(field: BarnField, draws: str) -> World:
    # Not read from its SDF, which is equal to it and would take three times as long.
    cells = field.draw_grid(draws)
    note = note_draws(field, draws)
    return World(
        WORLD_NAME,
        (GROUND, *build_cylinders(cells)),
        field.course,
        f"BARN field {field.seed}",
        hashlib.sha256(note.encode()).hexdigest(),
        note=note,
        shortest_m=field.measure_shortest(cells),
    )


def build_cylinders(cells: Cells) -> Iterator[Body]:
    """Yield the cylinders of the walls around the start, and of the cells not surrounded by others.

    The walls close the start but for the side of the field.
    """
    near = np.lib.stride_tricks.sliding_window_view(np.pad(cells, 1), (3, 3)).all(axis=(2, 3))
    walls = [(row, -WALL_COLUMNS) for row in range(SIDE)]
    walls += [(row, column) for column in range(1 - WALL_COLUMNS, 0) for row in (0, SIDE - 1)]
    places = {"wall": walls, "cylinder": [(i, j) for i, j in np.argwhere(cells & ~near).tolist()]}
    shape = Shape("cylinder", (RADIUS_M, HEIGHT_M))
    for name, ones in places.items():
        for number, cell in enumerate(ones, 1):
            x, y = (round(value, 3) for value in locate(*cell))
            yield Body(f"{name}_{number}", Pose((x, y, HEIGHT_M / 2)), (shape,))


def read_grid(bodies: Sequence[Body]) -> Cells:
    """Return the cells in which bodies stand; others are left out."""
    cells = np.zeros((SIDE, SIDE), dtype=np.bool_)
    x, y = locate(0, 0)
    for body in bodies:
        row = round((body.pose.position[0] - x) / CELL_M)
        column = round((body.pose.position[1] - y) / CELL_M)
        if 0 <= row < SIDE and 0 <= column < SIDE:
            cells[row, column] = True
    return cells
