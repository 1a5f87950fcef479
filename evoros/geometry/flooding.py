"""Which cells of a grid are connected."""

import numpy as np
from numba import types
from numpy.typing import NDArray
from scipy import ndimage

from evoros.base.arrays import Array
from evoros.compilation.rules import A2, I8, compile_rule

FREE, REACHED = 1.0, 2.0
_FLOOD = types.void(A2, A2, I8, I8)


def find_connected(free: NDArray[np.bool_], start: tuple[int, int]) -> NDArray[np.bool_]:
    """Return which cells are connected with ``start``, which is free, diagonals included."""
    cells = np.where(free, FREE, 0.0)
    compile_rule(_flood, _FLOOD)(cells, np.empty((cells.size, 2)), *start)
    return np.equal(cells, REACHED)


def label_regions(free: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Number the regions of free cells that are connected by their sides, from 1; others are 0."""
    labels, _ = ndimage.label(free)
    return np.asarray(labels, dtype=np.int64)


def _flood(cells: Array, waiting: Array, row: int, column: int) -> None:
    """Mark the cells as reached; ``waiting`` has room for all of them."""
    cells[row, column] = REACHED
    waiting[0, 0], waiting[0, 1] = row, column
    count = 1
    while count > 0:
        count -= 1
        i, j = int(waiting[count, 0]), int(waiting[count, 1])
        for near_i in range(max(i - 1, 0), min(i + 2, cells.shape[0])):
            for near_j in range(max(j - 1, 0), min(j + 2, cells.shape[1])):
                if cells[near_i, near_j] == FREE:
                    cells[near_i, near_j] = REACHED
                    waiting[count, 0], waiting[count, 1] = near_i, near_j
                    count += 1
