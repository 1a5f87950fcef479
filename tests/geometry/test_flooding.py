"""Connected cells of a grid, and cells near others, against their definitions."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from evoros.geometry.free_space import Cells, find_connected, widen

grids = arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, max_side=12))


def near(cells: Cells, row: int, column: int, reach: int) -> Cells:
    return cells[max(row - reach, 0) : row + reach + 1, max(column - reach, 0) : column + reach + 1]


@given(grids, st.data())
def test_cells_are_connected_that_steps_to_neighbours_reach(
    free: Cells, data: st.DataObject
) -> None:
    row, column = (data.draw(st.integers(0, side - 1)) for side in free.shape)
    free[row, column] = True
    reached, count = np.zeros_like(free), -1
    reached[row, column] = True
    while reached.sum() != count:
        count = reached.sum()
        for i, j in np.argwhere(free).tolist():
            reached[i, j] |= near(reached, i, j, 1).any()
    np.testing.assert_array_equal(find_connected(free, (row, column)), reached)


@given(grids, st.integers(0, 3))
def test_cells_are_widened_along_rows_and_columns(cells: Cells, reach: int) -> None:
    wide = [
        [near(cells, i, j, reach).any() for j in range(cells.shape[1])] for i in range(len(cells))
    ]
    np.testing.assert_array_equal(widen(cells, reach), wide)
    np.testing.assert_array_equal(widen(np.array([cells, ~cells]), reach)[0], wide)
