"""Grids: obstacles within reach of each cell, connected cells, and cells near others."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from planar_cases import coordinates, lengths

from evoros.geometry.footprint import Footprint
from evoros.geometry.free_space import Cells, find_connected, widen
from evoros.geometry.grid import Grid, cell_at


@settings(deadline=None, max_examples=40)
@given(
    st.lists(st.tuples(coordinates, coordinates, lengths), max_size=30),
    st.floats(0.1, 5.0),
    st.tuples(st.floats(-20, 20), st.floats(-20, 20)),
)
def test_the_index_names_all_that_is_within_reach(
    discs: list[tuple[float, float, float]], reach: float, at: tuple[float, float]
) -> None:
    areas = [Footprint(np.array([[x, y]]), radius) for x, y, radius in discs]
    grid = Grid.around(areas, reach)
    starts, entries = grid.list_near(areas, reach)
    cell = cell_at(grid.to_array(), *at)
    named = set() if cell < 0 else set(entries[int(starts[cell]) : int(starts[cell + 1])].tolist())
    for name, (x, y, radius) in enumerate(discs):
        if math.hypot(x - at[0], y - at[1]) <= radius + reach - 1e-9:
            assert name in named
    if cell >= 0:  # and little more: what is within reach of the cell, not of the point
        far = 2.0 * grid.cell * math.sqrt(0.5) + 1e-9
        for name in named:
            x, y, radius = discs[int(name)]
            assert math.hypot(x - at[0], y - at[1]) <= radius + reach + far


def test_a_long_wall_is_listed_only_where_it_is_near() -> None:
    wall = Footprint(np.array([[-50.0, 0.0], [50.0, 0.0], [50.0, 0.2], [-50.0, 0.2]]))
    grid = Grid.around([wall], 5.0)
    _, entries = grid.list_near([wall], 5.0)
    assert 100 * 10 < len(entries) < 112 * 13


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
