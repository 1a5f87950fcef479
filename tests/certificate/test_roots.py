"""Roots have the bits of SciPy's, so that intervals stay as they were."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from evoros.certificate.roots import find_root


@given(
    st.sampled_from([math.tanh, math.expm1, math.sin, lambda x: x + x**5, lambda x: -x]),
    st.floats(0.1, 1.5),
    st.floats(-0.9, 0.9),
    st.floats(-14, -3),
    st.booleans(),
)
def test_roots_have_the_bits_of_scipys(
    curve: Callable[[float], float], steepness: float, root: float, digits: float, turned: bool
) -> None:
    ends = (1.0, -1.0) if turned else (-1.0, 1.0)
    xtol = 10.0**digits

    def function(x: float) -> float:
        return curve(steepness * (x - root))

    assert find_root(function, *ends, xtol) == brentq(function, *ends, xtol=xtol)


@pytest.mark.parametrize("end", [-1.0, 1.0])
def test_a_root_at_an_end_is_found(end: float) -> None:
    assert find_root(lambda x: x - end, -1.0, 1.0, 1e-9) == end
