"""Products and axes of small matrices."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evoros.base.arrays import Array, determinant, length, principal_axes, product

numbers = st.floats(-10.0, 10.0)
matrices = arrays(np.float64, (3, 3), elements=numbers)


@given(a=arrays(np.float64, (5, 3), elements=numbers), b=matrices)
def test_a_product_is_that_of_numpy(a: Array, b: Array) -> None:
    np.testing.assert_allclose(product(a, b), a @ b, atol=1e-12)
    np.testing.assert_allclose(product(a, b[0]), a @ b[0], atol=1e-12)
    np.testing.assert_allclose(product(b[0], b), b[0] @ b, atol=1e-12)
    assert float(product(b[0], b[1])) == b[0, 0] * b[1, 0] + b[0, 1] * b[1, 1] + b[0, 2] * b[1, 2]


@given(a=matrices)
def test_the_determinant_is_that_of_numpy(a: Array) -> None:
    np.testing.assert_allclose(determinant(a), np.linalg.det(a), atol=1e-10)
    assert determinant(np.stack([a, a])).shape == (2,)


@given(a=matrices, scale=st.sampled_from([1e-9, 1.0, 1e9]))
def test_principal_axes_are_a_rotation_that_makes_a_matrix_diagonal(a: Array, scale: float) -> None:
    tensor = scale * (a + a.T)
    moments, axes = principal_axes(tensor)
    assert (np.diff(moments) >= 0.0).all()
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-13)
    assert np.linalg.det(axes) > 0.0
    np.testing.assert_allclose(axes * moments @ axes.T, tensor, atol=1e-12 * scale * 60.0)


def test_axes_of_a_diagonal_matrix_are_exact() -> None:
    moments, axes = principal_axes(np.diag([2.0, 1.0, 3.0]))
    assert moments.tolist() == [1.0, 2.0, 3.0]
    assert sorted(map(abs, axes.ravel().tolist())) == [0.0] * 6 + [1.0] * 3


@given(v=arrays(np.float64, 3, elements=numbers))
def test_the_length_is_that_of_numpy(v: Array) -> None:
    np.testing.assert_allclose(length(v), np.linalg.norm(v), rtol=1e-14)
