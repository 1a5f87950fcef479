"""A grid over the ground that names, for each cell, what is within reach of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.compilation import compilable
from evoros.geometry.footprint import Footprint, distances

CELL_M = 1.0
MOST_CELLS = 250_000
"""A world of far apart obstacles gets larger cells instead of more."""

# The grid in a flat array.
ORIGIN_X, ORIGIN_Y, CELL, COLUMNS, ROWS = range(5)
"""Corner [m], edge of a cell [m], numbers of cells; then the starts of all cells, the entries."""
GRID_SIZE = 5


@dataclass(frozen=True, eq=False)
class Grid:
    """Square cells over the ground."""

    origin: Array  # (2,) [m]
    cell: float  # [m]
    shape: tuple[int, int]  # columns (x), rows (y)

    @classmethod
    def around(cls, areas: Sequence[Footprint], reach: float) -> "Grid":
        """A grid that covers all that is within ``reach`` [m] of an area; else of one cell."""
        if not areas:
            return cls(np.zeros(2), CELL_M, (1, 1))
        low = np.min([area.vertices.min(axis=0) - area.radius for area in areas], axis=0) - reach
        high = np.max([area.vertices.max(axis=0) + area.radius for area in areas], axis=0) + reach
        width, height = (high - low).tolist()
        cell = max(CELL_M, math.sqrt(width * height / MOST_CELLS))
        return cls(low, cell, (math.ceil(width / cell), math.ceil(height / cell)))

    def lists(self, areas: Sequence[Footprint], reach: float) -> tuple[Array, Array]:
        """The areas within ``reach`` [m] of each cell: starts (cells + 1,) and entries."""
        count = self.shape[0] * self.shape[1]
        found = [self._near(area, reach) for area in areas]
        if not found:
            return np.zeros(count + 1), np.zeros(0)
        cells = np.concatenate(found)
        names = np.repeat(np.arange(len(found)), [len(each) for each in found])
        entries = names[np.argsort(cells, kind="stable")]
        starts = np.concatenate(([0], np.cumsum(np.bincount(cells, minlength=count))))
        return starts.astype(np.float64), entries.astype(np.float64)

    def _near(self, area: Footprint, reach: float) -> NDArray[np.intp]:
        """The cells with a point within ``reach`` [m] of an area, and few others."""
        low = area.vertices.min(axis=0) - area.radius - reach - self.origin
        high = area.vertices.max(axis=0) + area.radius + reach - self.origin
        columns, rows = (
            np.arange(max(0, int(start // self.cell)), min(count, int(end // self.cell) + 1))
            for start, end, count in zip(low, high, self.shape, strict=True)
        )
        column, row = (each.ravel() for each in np.meshgrid(columns, rows))
        middles = (np.stack([column, row], axis=1) + 0.5) * self.cell + self.origin
        corner = self.cell * math.sqrt(0.5)  # from the middle of a cell
        near = distances(area, middles) <= reach + corner
        cells: NDArray[np.intp] = (row * self.shape[0] + column)[near]
        return cells

    def flat(self) -> Array:
        """(GRID_SIZE,) for ``cell_at``."""
        return np.array([*self.origin, self.cell, *self.shape], dtype=np.float64)


@compilable
def cell_at(grid: Array, x: float, y: float) -> int:
    """The number of the cell around a point [m]; -1 outside of the grid, and for NaN."""
    along = (x - grid[ORIGIN_X]) / grid[CELL]
    aside = (y - grid[ORIGIN_Y]) / grid[CELL]
    # So asked, a point that is no number is outside: it must not become the number of a cell.
    if not (0.0 <= along < grid[COLUMNS] and 0.0 <= aside < grid[ROWS]):
        return -1
    return int(aside) * int(grid[COLUMNS]) + int(along)
