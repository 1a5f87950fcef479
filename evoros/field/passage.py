"""Keeps a way open along a route while obstacles are placed beside it."""

import heapq
import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.geometry.footprint import Footprint, distances

CELL_M = 0.2
MARGIN_M = 0.1415
"""The maximum distance of a point between two neighbouring cell centres from the nearer one.

It is 0.2 / sqrt(2), rounded up. So a disc that is free at all cell centres of a way, with this
margin to spare, is free all along it.
"""
_STRAIGHT, _DIAGONAL = 10, 14  # lengths of steps in whole numbers: no sum depends on rounding
_GREED = 2  # weight of the heuristic: the way may be longer, but far fewer cells are visited


class Passage:
    """A way for a disc of diameter ``width`` [m] along each leg of a route, among obstacles.

    ``low`` and ``high`` are opposite corners (2,) [m] of the field. Each of the points (n, 2) [m]
    of ``routes`` must have ``width / 2 + 2 * MARGIN_M`` of free ground around it; a leg leads from
    each to the next of its route. The search runs on a grid and finds every way that is half a
    metre wider than ``width``.
    """

    def __init__(self, low: Array, high: Array, routes: Sequence[Array], width: float) -> None:
        self._low = low
        columns, rows = (math.ceil((b - a) / CELL_M) for a, b in zip(low, high, strict=True))
        self._stride = columns + 2  # a border that is never free, so that no step leaves the grid
        self._free = np.zeros((rows + 2, self._stride), dtype=np.bool_)
        self._free[1:-1, 1:-1] = True
        self._radius = width / 2 + MARGIN_M
        self._ends = [ends for points in routes for ends in pairwise(points)]
        self._legs = [(self._cell(start), self._cell(end)) for start, end in self._ends]
        self._ways = [_find_way(self._free, *leg) or [] for leg in self._legs]

    def add(self, footprint: Footprint) -> bool:
        """Add an obstacle if every leg still has a way, and return whether it has."""
        window, blocked = self._find_blocked(footprint)
        before = self._free[window].copy()
        self._free[window] &= ~blocked
        ways = list(self._ways)
        free = self._free.ravel()
        for index, leg in enumerate(self._legs):
            if free[ways[index]].all():
                continue
            way = _find_way(self._free, *leg)
            if way is None:
                self._free[window] = before
                return False
            ways[index] = way
        self._ways = ways
        return True

    @property
    def ways(self) -> list[Array]:
        """The points (n, 2) [m] of the way along each leg, the ends of the leg included."""
        ways = []
        for way, (start, end) in zip(self._ways, self._ends, strict=True):
            row, column = np.divmod(np.array(way), self._stride)
            ways.append(np.vstack((start, self._centres(column, row), end)))
        return ways

    def _cell(self, point: Array) -> int:
        column, row = (int((p - a) / CELL_M) + 1 for p, a in zip(point, self._low, strict=True))
        return int(row * self._stride + column)

    def _centres(self, column: NDArray[np.intp], row: NDArray[np.intp]) -> Array:
        """Return the centres (n, 2) [m] of cells."""
        centres: Array = self._low + CELL_M * (np.column_stack((column, row)) - 0.5)
        return centres

    def _find_blocked(self, footprint: Footprint) -> tuple[tuple[slice, slice], NDArray[np.bool_]]:
        """Return a window of the grid, and its cells in which the disc would touch an obstacle."""
        reach = footprint.radius + self._radius + CELL_M
        vertices = footprint.vertices
        corners = vertices.min(axis=0) - reach, vertices.max(axis=0) + reach
        cells = (np.floor((corner - self._low) / CELL_M).astype(int) + 1 for corner in corners)
        (x0, y0), (x1, y1) = (np.clip(cell, 0, self._free.shape[::-1]) for cell in cells)
        column, row = np.meshgrid(np.arange(x0, x1), np.arange(y0, y1))
        near = distances(footprint, self._centres(column.ravel(), row.ravel())) < self._radius
        return (slice(y0, y1), slice(x0, x1)), near.reshape(column.shape)


def _find_way(free: NDArray[np.bool_], start: int, goal: int) -> list[int] | None:
    """Find a way over free cells, diagonal steps included, as flat indices (weighted A*)."""
    stride = free.shape[1]
    steps = [
        (row * stride + column, _DIAGONAL if row and column else _STRAIGHT)
        for row in (-1, 0, 1)
        for column in (-1, 0, 1)
        if row or column
    ]
    goal_row, goal_column = divmod(goal, stride)
    free_cells, cost, previous = free.ravel().tobytes(), {start: 0}, {start: start}
    queue = [(0, 0, start)]
    done: set[int] = set()
    while queue:
        _, _, cell = heapq.heappop(queue)
        if cell == goal:
            way = [goal]
            while previous[way[-1]] != way[-1]:
                way.append(previous[way[-1]])
            return way[::-1]
        if cell in done:
            continue
        done.add(cell)
        cell_cost = cost[cell]
        for step, length in steps:
            neighbour, total = cell + step, cell_cost + length
            if free_cells[neighbour] and total < cost.get(neighbour, total + 1):
                cost[neighbour], previous[neighbour] = total, cell
                row, column = divmod(neighbour, stride)
                down, aside = abs(row - goal_row), abs(column - goal_column)
                left = _STRAIGHT * max(down, aside) + (_DIAGONAL - _STRAIGHT) * min(down, aside)
                heapq.heappush(queue, (total + _GREED * left, left, neighbour))
    return None
