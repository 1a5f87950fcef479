"""Connected cells of a grid, against scipy's labels."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from numpy.typing import NDArray
from scipy import ndimage

from evoros.geometry.flooding import find_connected


@given(arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, max_side=12)), st.data())
def test_cells_are_connected_that_have_the_label_of_the_start(
    free: NDArray[np.bool_], data: st.DataObject
) -> None:
    start = tuple(data.draw(st.integers(0, side - 1)) for side in free.shape)
    free[start] = True
    labels, _ = ndimage.label(free, np.ones((3, 3)))
    row, column = start
    np.testing.assert_array_equal(find_connected(free, (row, column)), labels == labels[start])
