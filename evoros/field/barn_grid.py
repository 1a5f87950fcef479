"""The grid of a BARN world: cells with and without a cylinder, and the shortest way across.

The procedure, its numbers and its places are those of Perille, Truong, Xiao and Stone,
"Benchmarking Metric Ground Navigation", 2020 (arXiv 2008.13315), and of their generator
(github.com/dperille/jackal-map-creation). Rows of the grid lead across the field, along x, columns
along the way through it, along y.
"""

import heapq
import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from evoros.geometry.flooding import label_regions

Cells = NDArray[np.bool_]
Point = tuple[float, float]
Cell = tuple[int, int]  # row and column

SIDE = 30
"""The number of rows and of columns."""
CELL_M = 0.15
FIRST_X_M, FIRST_Y_M = -4.425, 5.175
"""The middle of the first cell."""
REACH = 2
"""Cells that a robot needs free on each side of the cell of its middle."""
_BIRTH, _SURVIVAL = 5, 2  # neighbours that fill a cell, and that keep it filled
_STEPS = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]


def draw_grids(count: int, fill: float, smoothings: int, rng: Generator) -> Cells:
    """Draw grids (count, rows, columns) by a cellular automaton.

    It fills a share of the cells, and all of both outer rows, and smooths.
    """
    cells: Cells = rng.random((count, SIDE, SIDE)) < fill
    cells[:, [0, -1]] = True
    for _ in range(smoothings):
        near = _count_neighbours(cells)
        cells = (near >= _BIRTH) | (cells & (near >= _SURVIVAL))
    return cells


def _count_neighbours(cells: Cells) -> NDArray[np.int8]:
    """Count the filled ones of eight neighbours; those beyond the outer rows are filled."""
    framed = np.pad(cells.astype(np.int8), ((0, 0), (0, 0), (1, 1)))
    framed = np.pad(framed, ((0, 0), (1, 1), (0, 0)), constant_values=1)
    lines: NDArray[np.int8] = framed[:, :-2] + framed[:, 1:-1] + framed[:, 2:]
    counts: NDArray[np.int8] = lines[:, :, :-2] + lines[:, :, 1:-1] + lines[:, :, 2:] - cells
    return counts


def find_free(cells: Cells) -> Cells:
    """Return where the middle of a robot can be in grids: no cell within ``REACH`` is filled."""
    free = ~cells
    for axis in (-2, -1):
        margins = [(0, 0)] * cells.ndim
        margins[axis] = (REACH, REACH)
        framed = np.pad(free, margins, constant_values=True)
        windows = np.lib.stride_tricks.sliding_window_view(framed, 2 * REACH + 1, axis=axis)
        free = np.asarray(windows.all(axis=-1), dtype=np.bool_)
    return free


def has_corridor(free: Cells) -> bool:
    """Return whether the largest free region at the first column is the one at the last, too."""
    if not free.any(axis=0).all():
        return False
    regions = label_regions(free)
    first, last = (_largest(regions, column) for column in (0, SIDE - 1))
    return 0 < first == last


def _largest(regions: NDArray[np.int64], column: int) -> int:
    """Return the number of the largest region with a cell in a column; 0: there is none."""
    sizes = np.bincount(regions.ravel())
    present = [number for number in dict.fromkeys(regions[:, column].tolist()) if number]
    return max(present, key=lambda number: int(sizes[number]), default=0)


def _is_free(free: Cells, row: int, column: int) -> bool:
    return 0 <= row < SIDE and 0 <= column < SIDE and bool(free[row, column])


def locate(row: float, column: float) -> Point:
    """Return the middle of a cell [m]."""
    return FIRST_X_M + CELL_M * row, FIRST_Y_M + CELL_M * column


def find_shortest(free: Cells, start: Point, goal: Point) -> list[Point]:
    """Find the shortest way (points [m]) across the grid, from ``start`` to ``goal`` beyond it.

    It leads straight to a free cell of the first column, from cell to one of eight free neighbours
    but not between two that are not free, and straight on from the last column. It is empty if
    there is none.
    """
    lengths: dict[Cell, float] = {}
    before: dict[Cell, Cell | None] = {}
    entries = [(int(row), 0) for row in np.flatnonzero(free[:, 0])]
    queue: list[tuple[float, Cell, Cell | None]] = []
    for cell in entries:
        heapq.heappush(queue, (math.dist(start, locate(*cell)), cell, None))
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
        if not _is_free(free, row + i, column + j):
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


def measure_way(way: list[Point]) -> float:
    """Return the length of a way [m]."""
    return math.fsum(math.dist(a, b) for a, b in pairwise(way))
