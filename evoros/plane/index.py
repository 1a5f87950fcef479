"""A grid over the ground that names, for each cell, what is within reach of it."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evoros.compiled import compilable
from evoros.types import Array

CELL_M = 1.0
MOST_CELLS = 250_000
"""A world of far apart obstacles gets larger cells instead of more."""

# The grid in a flat array.
ORIGIN_X, ORIGIN_Y, CELL, COLUMNS, ROWS = range(5)
"""Corner [m], edge of a cell [m], numbers of cells; then the starts of all cells, the entries."""
GRID_SIZE = 5


@dataclass(frozen=True, eq=False)
class Grid:
    """Square cells around all discs, which reach at least ``reach`` [m] farther than these."""

    origin: Array  # (2,) [m]
    cell: float  # [m]
    shape: tuple[int, int]  # columns (x), rows (y)

    @classmethod
    def around(cls, discs: Array, reach: float) -> "Grid":
        """``discs`` (n, 3) are centres and radii [m]; one cell where there are none."""
        if not len(discs):
            return cls(np.zeros(2), CELL_M, (1, 1))
        low = (discs[:, :2] - discs[:, 2:]).min(axis=0) - reach
        width, height = (discs[:, :2] + discs[:, 2:]).max(axis=0) + reach - low
        cell = max(CELL_M, math.sqrt(width * height / MOST_CELLS))
        return cls(low, cell, (math.ceil(width / cell), math.ceil(height / cell)))

    def lists(self, discs: Array, reach: float) -> tuple[Array, Array]:
        """The discs within ``reach`` [m] of each cell: starts (cells + 1,) and entries."""
        columns, rows = self.shape
        cells, names = [], []
        for name, (x, y, radius) in enumerate(discs):
            far = radius + reach
            found = self._within(x - self.origin[0], y - self.origin[1], far)
            cells.append(found)
            names.append(np.full(len(found), name))
        if not cells:
            return np.zeros(columns * rows + 1), np.zeros(0)
        cell, entries = np.concatenate(cells), np.concatenate(names)
        order = np.argsort(cell, kind="stable")
        counts = np.bincount(cell, minlength=columns * rows)
        starts = np.concatenate(([0], np.cumsum(counts)))
        return starts.astype(np.float64), entries[order].astype(np.float64)

    def _within(self, x: float, y: float, far: float) -> NDArray[np.intp]:
        """The cells that some point within ``far`` [m] of (x, y) lies in."""
        columns, rows = self.shape
        i = _span(x, far, self.cell, columns)
        j = _span(y, far, self.cell, rows)
        dx = np.maximum(np.maximum(i * self.cell - x, x - (i + 1) * self.cell), 0.0)
        dy = np.maximum(np.maximum(j * self.cell - y, y - (j + 1) * self.cell), 0.0)
        near = dy[:, None] ** 2 + dx[None] ** 2 <= far * far
        found: NDArray[np.intp] = (j[:, None] * columns + i[None])[near]
        return found

    def flat(self) -> Array:
        """(GRID_SIZE,) for ``cell_at``."""
        return np.array([*self.origin, self.cell, *self.shape], dtype=np.float64)


def _span(at: float, far: float, cell: float, count: int) -> NDArray[np.intp]:
    """The numbers of the cells along one axis that are within ``far`` [m]."""
    return np.arange(max(0, int((at - far) // cell)), min(count, int((at + far) // cell) + 1))


@compilable
def cell_at(grid: Array, x: float, y: float) -> int:
    """The number of the cell around a point [m]; -1 outside of the grid, and for NaN."""
    along = (x - grid[ORIGIN_X]) / grid[CELL]
    aside = (y - grid[ORIGIN_Y]) / grid[CELL]
    # So asked, a point that is no number is outside: it must not become the number of a cell.
    if not (0.0 <= along < grid[COLUMNS] and 0.0 <= aside < grid[ROWS]):
        return -1
    return int(aside) * int(grid[COLUMNS]) + int(along)
