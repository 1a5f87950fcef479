"""A grid of the places at which the centre of a robot meets no obstacle and stands on ground."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.geometry.footprint import Footprint, distances

CELL_M = 0.1


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """A grid of places where the centre of a robot meets no obstacle."""

    low: Array  # (2,) [m], corner of the grid
    free: NDArray[np.bool_]  # (rows along y, columns along x), cells of ``CELL_M``

    @classmethod
    def within(
        cls,
        low: Array,
        high: Array,
        footprints: Sequence[Footprint],
        radius_m: float,
        ground: Sequence[Footprint] | None = None,
    ) -> "FreeSpace":
        """Return the places between two corners [m] that are farther than a radius from footprints.

        Places are free as far as the ``ground`` reaches, which has no end if it is None.
        """
        columns, rows = np.ceil((np.maximum(high, low + 1.0) - low) / CELL_M).astype(int)
        space = cls(low, np.ones((rows, columns), dtype=np.bool_))
        if ground is not None:
            space._keep_on(ground, radius_m)
        for footprint in footprints:
            window, near = space._find_near(footprint, radius_m)
            space.free[window] &= ~near
        return space

    def _keep_on(self, ground: Sequence[Footprint], radius_m: float) -> None:
        """Keep the places around which there is ground up to a radius."""
        reach = radius_m / CELL_M + 1.0  # a cell without ground begins before its centre
        pad = math.ceil(reach)  # the ground may end beside the grid
        rows, columns = self.free.shape
        shape = (rows + 2 * pad, columns + 2 * pad)
        wide = FreeSpace(self.low - pad * CELL_M, np.zeros(shape, dtype=np.bool_))
        for footprint in ground:
            window, near = wide._find_near(footprint, 0.0)
            wide.free[window] |= near
        for y in range(-pad, pad + 1):
            for x in range(-pad, pad + 1):
                if math.hypot(x, y) <= reach:
                    self.free[:] &= wide.free[pad + y :, pad + x :][:rows, :columns]

    def _find_near(
        self, footprint: Footprint, radius_m: float
    ) -> tuple[tuple[slice, slice], NDArray[np.bool_]]:
        """Return a window of the grid, and which of its cells are within a radius of a shape."""
        reach = footprint.radius + radius_m
        ends = footprint.vertices.min(axis=0) - reach, footprint.vertices.max(axis=0) + reach
        cells = (np.floor((end - self.low) / CELL_M).astype(int) for end in ends)
        rows, columns = self.free.shape
        (x0, y0), (x1, y1) = (np.clip(cell, 0, (columns, rows)) for cell in cells)
        x, y = np.arange(x0, min(x1 + 1, columns)), np.arange(y0, min(y1 + 1, rows))
        column, row = np.meshgrid(x, y)
        centres = self.low + CELL_M * (np.column_stack((column.ravel(), row.ravel())) + 0.5)
        near = distances(footprint, centres) <= radius_m
        window = slice(y0, y0 + len(y)), slice(x0, x0 + len(x))
        return window, near.reshape(column.shape)

    def centres(self) -> Array:
        """Return the centres (n, 2) [m] of all free cells."""
        row, column = np.nonzero(self.free)
        centres: Array = self.low + CELL_M * (np.column_stack((column, row)) + 0.5)
        return centres

    def is_open(self, start: Array, end: Array) -> bool:
        """Return whether all cells on the straight line between two points are free."""
        count = 2 + int(math.dist(start, end) / (CELL_M / 2))
        points = start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)
        column, row = np.floor((points - self.low) / CELL_M).astype(int).T
        inside = (row >= 0) & (column >= 0)
        inside &= (row < self.free.shape[0]) & (column < self.free.shape[1])
        return bool(inside.all() and self.free[row, column].all())
