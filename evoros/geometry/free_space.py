"""A grid of positions, free if a robot centred there is on ground and touches no obstacle."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.geometry.footprint import Footprint, distances

Cells = NDArray[np.bool_]


def find_connected(free: Cells, start: tuple[int, int]) -> Cells:
    """Return the mask of the cells connected to the free cell ``start``, diagonals included."""
    # Importing scipy.ndimage takes ten times as long as this search along runs of free cells.
    connected = np.zeros_like(free)
    steps = np.diff(np.pad(free, 1).astype(np.int8))
    rows = [[np.flatnonzero(row == step).tolist() for step in (1, -1)] for row in steps]
    waiting = [(start[0] + 1, start[1], start[1] + 1)]
    while waiting:
        row, first, end = waiting.pop()
        connected[row - 1, first:end] = True
        for near in (row - 1, row, row + 1):
            firsts, ends = rows[near]
            touching = slice(bisect_left(ends, first), bisect_right(firsts, end))
            waiting += [(near, *run) for run in zip(firsts[touching], ends[touching], strict=True)]
            del firsts[touching], ends[touching]
    return connected


def label_regions(free: Cells, diagonals: bool = False) -> NDArray[np.int64]:
    """Label the regions of side-connected free cells from 1; blocked cells are 0."""
    labels, _ = scipy.ndimage.label(free, np.ones((3, 3)) if diagonals else None)
    return np.asarray(labels, dtype=np.int64)


def widen(cells: Cells, reach: int) -> Cells:
    """Dilate marked cells of grids (..., rows, columns) by ``reach`` cells in rows and columns."""
    size = (1,) * (cells.ndim - 2) + (2 * reach + 1,) * 2
    return np.asarray(scipy.ndimage.maximum_filter(cells, size, mode="constant"), dtype=np.bool_)


CELL_M = 0.1


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """A grid of positions at which a robot's centre is clear of obstacles."""

    low: Array  # (2,) [m], corner of the grid
    free: Cells  # (rows along y, columns along x)
    cell_m: float = CELL_M

    @classmethod
    def within(
        cls,
        low: Array,
        high: Array,
        footprints: Sequence[Footprint],
        radius_m: float,
        ground: Sequence[Footprint] | None = None,
        cell_m: float = CELL_M,
    ) -> "FreeSpace":
        """Return a grid from ``low`` to ``high`` [m]: free if on ``ground`` and off footprints."""
        columns, rows = np.ceil((np.maximum(high, low + 1.0) - low) / cell_m).astype(int)
        space = cls(low, np.ones((rows, columns), dtype=np.bool_), cell_m)
        if ground is not None:
            space._keep_on(ground, radius_m)
        for footprint in footprints:
            window, near = space.find_near(footprint, radius_m)
            space.free[window] &= ~near
        return space

    def _keep_on(self, ground: Sequence[Footprint], radius_m: float) -> None:
        """Block all positions without ground everywhere within a radius."""
        reach = radius_m / self.cell_m + 1.0  # cells without ground start before their centre
        pad = math.ceil(reach)  # includes ground that ends just outside the grid
        none = np.pad(np.zeros_like(self.free), pad)
        wide = FreeSpace(self.low - pad * self.cell_m, none, self.cell_m)
        for footprint in ground:  # robots drive across seams between floors
            window, near = wide.find_near(footprint, self.cell_m / 2)
            wide.free[window] |= near
        inner = (slice(pad, -pad),) * 2
        self.free[:] &= scipy.ndimage.distance_transform_edt(wide.free)[inner] > reach

    def find_near(self, footprint: Footprint, radius_m: float) -> tuple[tuple[slice, slice], Cells]:
        """Return the window of the grid near a footprint, and its mask of cells within a radius."""
        reach = footprint.radius + radius_m
        ends = footprint.vertices.min(axis=0) - reach, footprint.vertices.max(axis=0) + reach
        cells = (np.floor((end - self.low) / self.cell_m).astype(int) for end in ends)
        rows, columns = self.free.shape
        (x0, y0), (x1, y1) = (np.clip(cell, 0, (columns, rows)) for cell in cells)
        x, y = np.arange(x0, min(x1 + 1, columns)), np.arange(y0, min(y1 + 1, rows))
        column, row = np.meshgrid(x, y)
        centres = self.low + self.cell_m * (np.column_stack((column.ravel(), row.ravel())) + 0.5)
        near = distances(footprint, centres) <= radius_m
        window = slice(y0, y0 + len(y)), slice(x0, x0 + len(x))
        return window, near.reshape(column.shape)

    def centres(self) -> Array:
        """Return the centres (n, 2) [m] of all free cells."""
        row, column = np.nonzero(self.free)
        return np.asarray(self.low + self.cell_m * (np.column_stack((column, row)) + 0.5))

    @cached_property
    def _clearances(self) -> Array:
        return np.asarray(scipy.ndimage.distance_transform_edt(self.free) * self.cell_m)

    def measure_clearance(self, points: Array) -> Array:
        """Return the distance [m] from each grid point (..., 2) [m] to the nearest blocked cell."""
        columns, rows = np.moveaxis(np.floor((points - self.low) / self.cell_m).astype(int), -1, 0)
        return np.asarray(self._clearances[rows, columns])

    def is_open(self, start: Array, end: Array) -> bool:
        """Return True if all cells on the line segment between two points [m] are free."""
        count = 2 + int(math.dist(start, end) / (self.cell_m / 2))
        points = start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)
        column, row = np.floor((points - self.low) / self.cell_m).astype(int).T
        inside = (row >= 0) & (column >= 0)
        inside &= (row < self.free.shape[0]) & (column < self.free.shape[1])
        return bool(inside.all() and self.free[row, column].all())


DIRECTIONS = (
    *((x, y) for x in range(-2, 3) for y in range(-2, 3) if abs(x) + abs(y) in (1, 3)),
    *((x, y) for x in (-1, 1) for y in (-1, 1)),
)
"""Sixteen directions, about 22.5 deg apart, as (x, y) steps."""
SHELTERED = 13  # minimum number of blocked directions (of 16); 12 are blocked at outer corners
WALLED = 0.7  # minimum fraction of obstacles on an enclosed region's border; the rest is doors
# sufficient share of all free cells or of all enclosed cells, and required share of free cells
LARGE_SHARE, ONE_SHARE, LEAST_SHARE = 0.2, 0.5, 0.01


def find_enclosed(free: Cells) -> Cells | None:
    """Return the largest sheltered region with walls around it, such as a room; None if none."""
    blocked = np.sum([_look(free, x, y) for x, y in DIRECTIONS], axis=0)
    regions, total = label_regions(free & (blocked >= SHELTERED)), float(free.sum())
    sizes = np.bincount(regions.ravel())
    numbers = np.flatnonzero(sizes[1:] >= LEAST_SHARE * total) + 1
    candidates = [np.equal(regions, number) for number in numbers]
    enclosed = [region for region in candidates if _measure_walls(region, free) >= WALLED]
    areas = [float(region.sum()) for region in enclosed]
    if not areas or max(areas) < min(LARGE_SHARE * total, ONE_SHARE * sum(areas)):
        return None
    return enclosed[int(np.argmax(areas))]


def _look(free: Cells, x: int, y: int) -> Cells:
    """Return the cells from which repeated steps of (x, y) cells end at a blocked cell."""
    if x == 0:
        return _look(free.T, y, 0).T
    rows, columns = free.shape
    ends = np.zeros((rows + 2 * abs(y), columns), dtype=np.bool_)  # no ray ends beyond the grid
    inner = slice(abs(y), abs(y) + rows)
    for column in range(columns)[:: -1 if x > 0 else 1]:
        if 0 <= column + x < columns:
            ahead = np.zeros(rows + 2 * abs(y), dtype=np.bool_)
            ahead[inner] = ~free[:, column + x]
            ahead |= ends[:, column + x]
            ends[inner, column] = ahead[abs(y) + y : abs(y) + y + rows]
    return ends[inner]


def _measure_walls(region: Cells, free: Cells) -> float:
    """Return the fraction of a region's outer border that consists of obstacles."""
    padded = np.pad(scipy.ndimage.binary_fill_holes(region), 1)
    around = np.pad(free, 1, constant_values=True)
    walls = sides = 0
    for axis in (0, 1):
        for step in (-1, 1):
            edge = padded & ~np.roll(padded, step, axis)
            walls += int((np.roll(~around, step, axis) & edge).sum())
            sides += int(edge.sum())
    return walls / sides
