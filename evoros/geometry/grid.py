"""A grid over the ground that lists the footprints near each cell."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.geometry.footprint import Footprint, distances, find_bounds

CELL_M = 1.0
MAX_CELLS = 250_000  # maximum number of cells; if obstacles are far apart, cells are larger

# A flat array of GRID_SIZE values describes the grid.
ORIGIN_X, ORIGIN_Y, CELL, COLUMNS, ROWS = range(5)  # corner [m], cell's edge [m], numbers
GRID_SIZE = 5


@dataclass(frozen=True, eq=False)
class Grid:
    """A grid of square cells over the ground."""

    origin: Array  # (2,) [m]
    cell: float  # [m]
    shape: tuple[int, int]  # columns (x), rows (y)

    @classmethod
    def around(cls, footprints: Sequence[Footprint], reach: float) -> "Grid":
        """Cover all points within ``reach`` [m] of a footprint; one cell without footprints."""
        if not footprints:
            return cls(np.zeros(2), CELL_M, (1, 1))
        low, high = find_bounds(*footprints)
        low, high = low - reach, high + reach
        width, height = (high - low).tolist()
        cell = max(CELL_M, math.sqrt(width * height / MAX_CELLS))
        return cls(low, cell, (math.ceil(width / cell), math.ceil(height / cell)))

    def list_near(self, footprints: Sequence[Footprint], reach: float) -> tuple[Array, Array]:
        """List the footprints within ``reach`` [m] of each cell: starts (cells + 1,), indices."""
        count = self.shape[0] * self.shape[1]
        near = [self._cells_near(footprint, reach) for footprint in footprints]
        if not near:
            return np.zeros(count + 1), np.zeros(0)
        cells = np.concatenate(near)
        indices = np.repeat(np.arange(len(near)), [len(cells_near) for cells_near in near])
        entries = indices[np.argsort(cells, kind="stable")]
        starts = np.concatenate(([0], np.cumsum(np.bincount(cells, minlength=count))))
        return starts.astype(np.float64), entries.astype(np.float64)

    def _cells_near(self, footprint: Footprint, reach: float) -> NDArray[np.intp]:
        """Return all cells with a point within ``reach`` [m] of a footprint, and some others."""
        low, high = find_bounds(footprint)
        columns, rows = (
            np.arange(max(0, int(start // self.cell)), min(count, int(end // self.cell) + 1))
            for start, end, count in zip(
                low - reach - self.origin, high + reach - self.origin, self.shape, strict=True
            )
        )
        column, row = (index.ravel() for index in np.meshgrid(columns, rows))
        centres = (np.stack([column, row], axis=1) + 0.5) * self.cell + self.origin
        half_diagonal = self.cell * math.sqrt(0.5)
        near = distances(footprint, centres) <= reach + half_diagonal
        return np.asarray((row * self.shape[0] + column)[near])

    def to_array(self) -> Array:
        """Return the grid as an array (GRID_SIZE,) for ``cell_at``."""
        return np.array([*self.origin, self.cell, *self.shape], dtype=np.float64)


@compilable
def cell_at(grid: Array, x: float, y: float) -> int:
    """Return the index of the cell that contains a point [m]; -1 for NaN and outside the grid."""
    column = (x - grid[ORIGIN_X]) / grid[CELL]
    row = (y - grid[ORIGIN_Y]) / grid[CELL]
    # The negated condition also catches NaN, which must not become a cell index.
    if not (0.0 <= column < grid[COLUMNS] and 0.0 <= row < grid[ROWS]):
        return -1
    return int(row) * int(grid[COLUMNS]) + int(column)
