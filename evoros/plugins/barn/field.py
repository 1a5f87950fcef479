"""Worlds like BARN's: fields of cylinders from a cellular automaton, with a path across.

The procedure, constants and positions follow Perille, Truong, Xiao and Stone, "Benchmarking Metric
Ground Navigation", 2020 (arXiv 2008.13315), and github.com/dperille/jackal-map-creation. The row
index increases across the field (x), the column index along the path (y).
"""

import hashlib
import heapq
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise, product
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from evoros.base.checks import COUNT, PROBABILITY, SEED, checked, invalid, sequence_of
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.field.drawn import draw_example, note_draws
from evoros.files.resources import expand_home, read_file
from evoros.geometry.free_space import Cells, label_regions, widen
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.terminal.log import withhold_messages
from evoros.world.course import A_COURSE, Course
from evoros.world.floors import GROUND
from evoros.world.loading import load_world
from evoros.world.model import KEPT_WORLDS, World

Point = tuple[float, float]
Cell = tuple[int, int]  # row and column

SIDE = 30  # number of rows and of columns
CELL_M = 0.15
FIRST_X_M, FIRST_Y_M = -4.425, 5.175  # x, y of the centre of the first cell
REACH = 2  # number of cells around a robot's centre cell that must be free on each side
_BIRTH, _SURVIVAL = 5, 2  # numbers of filled neighbours that fill a free cell and keep a filled one
_STEPS = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]


def draw_grids(count: int, fill: float, smoothings: int, rng: Generator) -> Cells:
    """Generate grids (count, rows, columns) by smoothing random cells between filled outer rows."""
    cells: Cells = rng.random((count, SIDE, SIDE)) < fill
    cells[:, [0, -1]] = True
    for _ in range(smoothings):
        near = _count_neighbours(cells)
        cells = (near >= _BIRTH) | (cells & (near >= _SURVIVAL))
    return cells


def _count_neighbours(cells: Cells) -> NDArray[np.int8]:
    """Count the filled cells among the eight neighbours; cells beyond the outer rows are filled."""
    framed = np.pad(cells.astype(np.int8), ((0, 0), (0, 0), (1, 1)))
    framed = np.pad(framed, ((0, 0), (1, 1), (0, 0)), constant_values=1)
    lines = framed[:, :-2] + framed[:, 1:-1] + framed[:, 2:]
    return np.asarray(lines[:, :, :-2] + lines[:, :, 1:-1] + lines[:, :, 2:] - cells)


def find_free(cells: Cells) -> Cells:
    """Return the cells possible for a robot's centre: no filled cell within ``REACH``."""
    return ~widen(cells, REACH)


def has_corridor(free: Cells) -> bool:
    """Return True if the largest region at the first column is also the largest at the last."""
    if not free.any(axis=0).all():
        return False
    regions = label_regions(free)
    first, last = (_largest(regions, column) for column in (0, SIDE - 1))
    return 0 < first == last


def _largest(regions: NDArray[np.int64], column: int) -> int:
    sizes = np.bincount(regions.ravel())
    present = [number for number in dict.fromkeys(regions[:, column].tolist()) if number]
    return max(present, key=lambda number: int(sizes[number]), default=0)


def locate(row: float, column: float) -> Point:
    """Return the centre of a cell [m]."""
    return FIRST_X_M + CELL_M * row, FIRST_Y_M + CELL_M * column


def find_shortest(free: Cells, start: Point, goal: Point) -> list[Point]:
    """Return the shortest path from ``start`` across the grid to ``goal``, as points [m].

    The path goes straight to the first column, then between free neighbouring cells (not diagonally
    between two blocked cells), then straight to ``goal``. It is empty if there is no such path.
    """
    lengths: dict[Cell, float] = {}
    before: dict[Cell, Cell | None] = {}
    entries = [(int(row), 0) for row in np.flatnonzero(free[:, 0])]
    queue: list[tuple[float, Cell, Cell | None]]
    queue = [(math.dist(start, locate(*cell)), cell, None) for cell in entries]
    heapq.heapify(queue)
    while queue:
        length, cell, last = heapq.heappop(queue)
        if cell in lengths:
            continue
        lengths[cell], before[cell] = length, last
        for near, step in _list_steps(free, *cell):
            if near not in lengths:
                heapq.heappush(queue, (length + CELL_M * step, near, cell))
    ends = [cell for cell in lengths if cell[1] == SIDE - 1]
    if not ends:
        return []
    end = min(ends, key=lambda cell: (lengths[cell] + math.dist(locate(*cell), goal), cell))
    return [start, *_trace(before, end), goal]


def _list_steps(free: Cells, row: int, column: int) -> Iterator[tuple[Cell, float]]:
    for i, j in _STEPS:
        if not (0 <= row + i < SIDE and 0 <= column + j < SIDE and free[row + i, column + j]):
            continue
        if i and j and not (free[row + i, column] or free[row, column + j]):
            continue
        yield (row + i, column + j), math.sqrt(2.0) if i and j else 1.0


def _trace(before: dict[Cell, Cell | None], end: Cell) -> list[Point]:
    way = []
    cell: Cell | None = end
    while cell is not None:
        way.append(locate(*cell))
        cell = before[cell]
    return way[::-1]


def measure_way(way: Sequence[Sequence[float]]) -> float:
    """Return the length of a path [m]."""
    return math.fsum(math.dist(a, b) for a, b in pairwise(way))


PATHS = "path_files"
_PATH_ORIGIN_M = (-4.575, 5.075)  # position of cell (0, 0) in a path file, as in run.py
WORLD_NAME = "barn"
RADIUS_M, HEIGHT_M = 0.075, 1.0  # size of each cylinder
WALL_COLUMNS = 34  # length, in cells, of both walls from the start to the first column
BATCH, MAX_BATCHES = 32, 2000  # grids per batch, and maximum batches without a corridor


@dataclass(frozen=True)
@checked
class BarnField:
    """A distribution of BARN worlds; a world depends on ``seed`` and a mission's key of draws."""

    course: Annotated[Course, A_COURSE]
    fill: Annotated[Sequence[float], sequence_of(float, "shares")]  # initial shares of filled cells
    smoothings: Annotated[Sequence[int], sequence_of(int, "integers")]
    seed: Annotated[int, SEED] = 0

    kind: ClassVar[str] = "field"

    def __post_init__(self) -> None:
        for name, rule in (("fill", PROBABILITY), ("smoothings", COUNT)):
            values = tuple(getattr(self, name))
            if not values or not all(map(rule.holds, values)):
                raise invalid(self, name, list(values), f"must be a list, each item {rule.text}")
            object.__setattr__(self, name, values)  # hashable types, for use as a cache key

    def draw_world(self, draws: str) -> World:
        """Generate the world for a key of random draws; recent worlds are cached."""
        return _draw_world(self, draws)

    def draw_grid(self, draws: str) -> Cells:
        """Generate the cells that contain cylinders."""
        rng = generator(draws, f"barn {self.seed}")
        pairs = list(product(self.fill, self.smoothings))
        fill, smoothings = pairs[int(rng.integers(len(pairs)))]
        for _ in range(MAX_BATCHES):
            grids = draw_grids(BATCH, fill, smoothings, rng)
            for index, free in enumerate(find_free(grids)):
                if has_corridor(free):
                    return np.asarray(grids[index], dtype=np.bool_)
        rule = f"must leave a corridor in at least one of {MAX_BATCHES * BATCH} random grids"
        raise invalid(self, "fill", list(self.fill), rule, "lower this share")

    def measure_shortest(self, cells: Cells) -> float:
        """Return the length [m] of the shortest path from home to the last waypoint."""
        home, goal = self.course.home[:2], self.course.waypoints[-1]
        return measure_way(find_shortest(find_free(cells), home, (goal[0], goal[1])))


def generate_barn(
    course: Course,
    fill: Sequence[float],
    smoothings: Sequence[int],
    seed: int = 0,
    renew: bool = True,
) -> World:
    """Generate a random world like BARN's; if ``renew``, generate one for each mission."""
    return draw_example(BarnField(course, fill, smoothings, seed), renew, "generate_barn")


@lru_cache(maxsize=KEPT_WORLDS)
def _draw_world(field: BarnField, draws: str) -> World:
    # Reading this world back from SDF would give an equal world, but take three times as long.
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
    """Yield the cylinders of the walls around the start, and of filled cells that rays can hit."""
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
    """Return the cells that contain bodies; ignore bodies outside the grid."""
    cells = np.zeros((SIDE, SIDE), dtype=np.bool_)
    x, y = locate(0, 0)
    for body in bodies:
        row = round((body.pose.position[0] - x) / CELL_M)
        column = round((body.pose.position[1] - y) / CELL_M)
        if 0 <= row < SIDE and 0 <= column < SIDE:
            cells[row, column] = True
    return cells


@dataclass(frozen=True)
class BarnFiles:
    """The world files of a folder, sorted by number; trial N uses world N."""

    files: Annotated[tuple[str, ...], sequence_of(str, "paths")]
    course: Annotated[Course, A_COURSE]

    def draw_world(self, draws: str) -> World:
        """Load the world for the trial number at the end of ``draws``; without a number, file 0."""
        trial = draws.rpartition("/")[2]
        number = int(trial) if trial.isdecimal() else 0
        return _load_file(self.files[number % len(self.files)], self.course)


def load_barn(folder: str, course: Course) -> World:
    """Load the files ``world_N.world`` in a folder; trial N uses world N.

    The shortest path is read from ``path_files/path_N.npy``, or computed if this is missing.
    """
    place = expand_home(folder)
    found = {
        int(path.stem.removeprefix("world_")): path
        for path in place.glob("world_*.world")
        if re.fullmatch(r"world_\d+", path.stem)
    }
    if not found:
        raise InputError(
            f"{folder}: no files named world_N.world were found; clone "
            f"https://github.com/Daffan/the-barn-challenge, and give its folder "
            f"jackal_helper/worlds/BARN"
        )
    files = tuple(str(found[number].resolve()) for number in sorted(found))
    digest = hashlib.sha256()
    for file in files:
        digest.update(read_file(Path(file)))
        path = _name_path(Path(file))
        digest.update(read_file(path) if path.is_file() else b"")
    sampler = BarnFiles(files, course)
    return replace(sampler.draw_world(""), sampler=sampler, source_sha256=digest.hexdigest())


def _name_path(world: Path) -> Path:
    return world.parent / PATHS / f"{world.stem.replace('world', 'path')}.npy"


@lru_cache(maxsize=KEPT_WORLDS)
def _load_file(file: str, course: Course) -> World:
    with withhold_messages():
        world = load_world(file, course)
    path = _name_path(Path(file))
    shortest = _measure_path(path, course) if path.is_file() else _plan(world)
    if not shortest:
        raise InputError(f"{file}: no path leads across the grid; remove the file")
    return replace(world, name="barn_files", shortest_m=shortest)


def _plan(world: World) -> float:
    (x, y), home = world.course.waypoints[-1], world.course.home[:2]
    return measure_way(find_shortest(find_free(read_grid(world.obstacles)), home, (x, y)))


def _measure_path(path: Path, course: Course) -> float:
    try:
        cells = np.load(path, allow_pickle=False)
        points = np.asarray(cells, dtype=np.float64).reshape(-1, 2) * CELL_M + _PATH_ORIGIN_M
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"{path}: not an array of cells ({error}); remove the file") from None
    return measure_way([course.home[:2], *points.tolist(), course.waypoints[-1]])
