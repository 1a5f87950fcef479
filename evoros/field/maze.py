"""Mazes of square cells in rows and columns, separated by walls with doors."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import Annotated, ClassVar

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, POSITIVE, SEED, checked, invalid, one_of, pick_index
from evoros.base.rng import generator
from evoros.field.drawn import Distribution, draw_example
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.course import A_COURSE, Course
from evoros.world.floors import GROUND
from evoros.world.model import World

SIDE = replace(COUNT, limit=100)
KEEP, OPEN, FILL = "keep", "open", "fill"
MAX_ATTEMPTS = 10_000  # maximum number of mazes drawn to find a corridor through all waypoints
OFF_CENTRE = 0.1  # maximum distance of a waypoint from its cell's centre, in corridor widths
Cell = tuple[int, int]  # column (along x) and row (along y)
Doors = dict[Cell, set[Cell]]  # neighbours of each cell that share a door with it
Run = tuple[int, int, int]  # a wall: indices of its grid line, and of its first and last cross line


@dataclass(frozen=True)
@checked
class Maze(Distribution):
    """A distribution of mazes centred on the course; home and waypoints are near cell centres.

    ``seed`` and the key of the random draws determine the bytes of the SDF. A random depth-first
    search generates a maze. Its dead ends are kept, opened by another door, or filled until only
    the corridor from home through all waypoints is left.
    """

    kind: ClassVar[str] = "maze"
    world_name: ClassVar[str] = "mazes"
    course: Annotated[Course, A_COURSE]
    columns: Annotated[int, SIDE]  # cells along x
    rows: Annotated[int, SIDE]  # cells along y
    corridor_m: Annotated[float, POSITIVE]  # distance between the walls on both sides
    wall_m: Annotated[float, POSITIVE]  # thickness of a wall
    wall_height_m: Annotated[float, POSITIVE]
    dead_ends: Annotated[str, one_of(KEEP, OPEN, FILL)]
    seed: Annotated[int, SEED] = 0

    def __post_init__(self) -> None:
        if self.columns * self.rows < 2:
            raise invalid(self, "columns", self.columns, "must be at least 2 if rows is 1")
        for point in self._points:
            cell = self._find_cell(point)
            centre = self.centre(cell)
            inside = 0 <= cell[0] < self.columns and 0 <= cell[1] < self.rows
            if not inside or np.abs(point - centre).max() > OFF_CENTRE * self.corridor_m:
                rule = "must have home and waypoints at centres of cells"
                fix = f"move this point to the nearest centre, {np.round(centre, 3).tolist()}"
                raise invalid(self, "course", point.tolist(), rule, fix)

    @property
    def pitch_m(self) -> float:
        """The distance [m] between adjacent cell centres."""
        return self.corridor_m + self.wall_m

    @property
    def _points(self) -> Array:
        return np.array([self.course.home[:2], *self.course.waypoints], dtype=np.float64)

    @property
    def route(self) -> list[Cell]:
        """The cells of home and the waypoints."""
        return [self._find_cell(point) for point in self._points]

    def centre(self, cell: Cell) -> Array:
        """Return the centre (2,) [m] of a cell."""
        return self._corner + (np.array(cell) + 0.5) * self.pitch_m

    @property
    def _corner(self) -> Array:
        """The corner (2,) [m] of the grid with the minimum coordinates, midway in the walls."""
        middle = (self._points.min(axis=0) + self._points.max(axis=0)) / 2
        return np.asarray(middle - np.array([self.columns, self.rows]) * self.pitch_m / 2)

    def _find_cell(self, point: Array) -> Cell:
        column, row = np.floor((point - self._corner) / self.pitch_m).astype(int).tolist()
        return column, row

    def draw_bodies(self, draws: str) -> tuple[Body, ...]:
        """Return the ground and the walls of a random maze."""
        return (GROUND, *self._build_walls(self.draw_doors(draws)))

    def draw_doors(self, draws: str) -> Doors:
        """Generate the doors of a maze with a corridor through all waypoints."""
        rng = generator(draws, f"maze {self.seed}")
        doors = self._connect(rng)
        for cell in doors if self.dead_ends == OPEN else ():
            closed = [near for near in self._neighbours(cell) if near not in doors[cell]]
            if len(doors[cell]) == 1 and closed:
                _add_door(doors, cell, closed[pick_index(float(rng.random()), len(closed))])
        if self.dead_ends != FILL:
            return doors
        for _ in range(MAX_ATTEMPTS):
            way = _find_way(doors, self.route[0], self.route[-1])
            places = [way.index(cell) if cell in way else -1 for cell in self.route]
            if min(places) >= 0 and places == sorted(set(places)):
                corridor: Doors = {cell: set() for cell in doors}
                for first, second in pairwise(way):
                    _add_door(corridor, first, second)
                return corridor
            doors = self._connect(rng)
        rule = (
            f"must lie in this order on a corridor in at least one of {MAX_ATTEMPTS} random mazes"
        )
        fix = "give fewer waypoints, or set dead_ends to keep or open"
        raise invalid(self, "course.waypoints", [*self.course.waypoints], rule, fix)

    def _neighbours(self, cell: Cell) -> list[Cell]:
        column, row = cell
        near = ((column + 1, row), (column, row + 1), (column - 1, row), (column, row - 1))
        return [(x, y) for x, y in near if 0 <= x < self.columns and 0 <= y < self.rows]

    def _connect(self, rng: Generator) -> Doors:
        doors: Doors = {(x, y): set() for x in range(self.columns) for y in range(self.rows)}
        stack, seen = [self.route[0]], {self.route[0]}
        while stack:
            new = [cell for cell in self._neighbours(stack[-1]) if cell not in seen]
            if not new:
                stack.pop()
                continue
            chosen = new[pick_index(float(rng.random()), len(new))]
            _add_door(doors, stack[-1], chosen)
            seen.add(chosen)
            stack.append(chosen)
        return doors

    def _build_walls(self, doors: Doors) -> Iterator[Body]:
        pitch, corner = self.pitch_m, self._corner
        for axis in (0, 1):
            for line, start, end in self._list_runs(doors, axis):
                length, middle = (end - start) * pitch + self.wall_m, (start + end) / 2
                place = corner + pitch * np.array((middle, line) if axis == 0 else (line, middle))
                sides = (length, self.wall_m) if axis == 0 else (self.wall_m, length)
                x, y = np.round(place, 6).tolist()
                size = tuple(round(side, 6) for side in (*sides, self.wall_height_m))
                shape = Shape("box", size)
                name = f"wall_{'xy'[axis]}_{line}_{start}"
                yield Body(name, Pose((x, y, self.wall_height_m / 2)), (shape,))

    def _list_runs(self, doors: Doors, axis: int) -> Iterator[Run]:
        """Yield the walls along x (axis 0) or y (axis 1) that border a cell with a door."""
        along, lines = (self.columns, self.rows) if axis == 0 else (self.rows, self.columns)

        def is_wall(step: int) -> bool:
            below, above = (step, line - 1), (step, line)
            if axis == 1:
                below, above = (line - 1, step), (line, step)
            near, far = doors.get(below, set()), doors.get(above, set())
            return bool(near or far) and above not in near

        for line in range(lines + 1):
            for solid, run in groupby(range(along), is_wall):
                steps = [*run]
                if solid:
                    yield line, steps[0], steps[-1] + 1


def generate_maze(
    course: Course,
    columns: int,
    rows: int,
    corridor_m: float,
    wall_m: float,
    wall_height_m: float,
    dead_ends: str,
    seed: int = 0,
    renew: bool = False,
) -> World:
    """Generate a maze, with ``renew`` a new one for each mission; see ``Maze``."""
    maze = Maze(course, columns, rows, corridor_m, wall_m, wall_height_m, dead_ends, seed)
    return draw_example(maze, renew, "generate_maze")


def _add_door(doors: Doors, first: Cell, second: Cell) -> None:
    doors[first].add(second)
    doors[second].add(first)


def _find_way(doors: Doors, start: Cell, goal: Cell) -> list[Cell]:
    previous, waiting = {start: start}, [start]
    while waiting:
        cell = waiting.pop()
        for near in doors[cell]:
            if near not in previous:
                previous[near] = cell
                waiting.append(near)
    way = [goal]
    while way[-1] != start:
        way.append(previous[way[-1]])
    return way[::-1]
