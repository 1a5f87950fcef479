"""Keeps a way open along a route while obstacles are put beside it."""

import heapq
import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.geometry.footprint import Footprint, distances

CELL_M = 0.2
MARGIN_M = 0.1415
"""Between the centres of neighbouring cells, at most this far from the nearer one: 0.2 / sqrt(2).

So a disc that is free at all centres of a way, with this to spare, is free all along it.
"""
_STRAIGHT, _DIAGONAL = 10, 14  # lengths of steps in whole numbers: no sum depends on rounding
_HASTE = 2  # a way needs not be the shortest: so many times fewer cells are looked at, and more


class Passage:
    """A way for a disc of the given width along each leg of a route, among a growing crowd.

    ``low`` and ``high`` are opposite corners [x, y] of the field [m]. Each of ``places`` must have
    ``width / 2 + 2 * MARGIN_M`` of free ground around it; a leg leads from each to the next.
    A way is looked for on a grid: it is found wherever there is room for half a metre more.
    """

    def __init__(
        self,
        low: Array,  # (2,)
        high: Array,  # (2,)
        places: Array,  # (n, 2)
        width: float,
    ) -> None:
        self._low = low
        columns, rows = (math.ceil((b - a) / CELL_M) for a, b in zip(low, high, strict=True))
        self._stride = columns + 2  # a border that is never free, so that no step leaves the grid
        self._free = np.zeros((rows + 2, self._stride), dtype=np.bool_)
        self._free[1:-1, 1:-1] = True
        self._keep = width / 2 + MARGIN_M
        self._places = places
        cells = [self._cell(place) for place in self._places]
        self._legs = list(pairwise(cells))
        self._ways = [_way(self._free, *leg) or [] for leg in self._legs]

    def add(self, area: Footprint) -> bool:
        """Put an obstacle there, if every leg still has a way; else leave it out."""
        window, blocked = self._blocked(area)
        before = self._free[window].copy()
        self._free[window] &= ~blocked
        ways = list(self._ways)
        free = self._free.ravel()
        for number, leg in enumerate(self._legs):
            if free[ways[number]].all():
                continue
            found = _way(self._free, *leg)
            if found is None:
                self._free[window] = before
                return False
            ways[number] = found
        self._ways = ways
        return True

    @property
    def ways(self) -> list[Array]:
        """The points (n, 2) [m] of the way along each leg, from place to place."""
        found = []
        for number, way in enumerate(self._ways):
            row, column = np.divmod(np.array(way), self._stride)
            centres = self._low + CELL_M * (np.column_stack((column, row)) - 0.5)
            found.append(np.vstack((self._places[number], centres, self._places[number + 1])))
        return found

    def _cell(self, place: Array) -> int:
        column, row = (int((p - a) / CELL_M) + 1 for p, a in zip(place, self._low, strict=True))
        return int(row * self._stride + column)

    def _blocked(self, area: Footprint) -> tuple[tuple[slice, slice], NDArray[np.bool_]]:
        """The cells in which the disc would touch an obstacle: a window, and which of it."""
        reach = area.radius + self._keep + CELL_M
        ends = area.vertices.min(axis=0) - reach, area.vertices.max(axis=0) + reach
        cells = (np.floor((end - self._low) / CELL_M).astype(int) + 1 for end in ends)
        (x0, y0), (x1, y1) = (np.clip(cell, 0, self._free.shape[::-1]) for cell in cells)
        x, y = np.meshgrid(np.arange(x0, x1), np.arange(y0, y1))
        centres = self._low + CELL_M * (np.column_stack((x.ravel(), y.ravel())) - 0.5)
        near = distances(area, centres) < self._keep
        return (slice(y0, y1), slice(x0, x1)), near.reshape(x.shape)


def _way(free: NDArray[np.bool_], start: int, goal: int) -> list[int] | None:
    """A way over free cells, diagonal steps included, as flat indices (A*, weighted)."""
    stride = free.shape[1]
    steps = [
        (row * stride + column, _DIAGONAL if row and column else _STRAIGHT)
        for row in (-1, 0, 1)
        for column in (-1, 0, 1)
        if row or column
    ]
    goal_row, goal_column = divmod(goal, stride)
    open_cells, cost, before = free.ravel().tobytes(), {start: 0}, {start: start}
    queue = [(0, 0, start)]
    done: set[int] = set()
    while queue:
        _, _, cell = heapq.heappop(queue)
        if cell == goal:
            return _back(before, goal)
        if cell in done:
            continue
        done.add(cell)
        here = cost[cell]
        for step, length in steps:
            other, total = cell + step, here + length
            if open_cells[other] and total < cost.get(other, total + 1):
                cost[other], before[other] = total, cell
                row, column = divmod(other, stride)
                down, aside = abs(row - goal_row), abs(column - goal_column)
                left = _STRAIGHT * max(down, aside) + (_DIAGONAL - _STRAIGHT) * min(down, aside)
                heapq.heappush(queue, (total + _HASTE * left, left, other))
    return None


def _back(before: dict[int, int], goal: int) -> list[int]:
    way = [goal]
    while before[way[-1]] != way[-1]:
        way.append(before[way[-1]])
    return way[::-1]
