"""Values of genes in intervals, and choices."""

import math

from hypothesis import example, given
from hypothesis import strategies as st

from evoros.base.checks import pick_index, scale


@given(st.floats(0, 1), st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
@example(1.0, -0.1, -0.01)  # -0.1 + (-0.01 - -0.1) is greater than -0.01
def test_rounding_never_leaves_an_interval(gene: float, one: float, other: float) -> None:
    low, high = sorted((one, other))
    assert low <= scale(gene, low, high) <= high
    assert scale(0, low, high) == low
    assert abs(scale(1, low, high) - high) <= math.ulp(max(abs(low), abs(high), high - low))


@given(st.integers(1, 1000), st.data())
def test_each_choice_has_its_own_share_of_the_interval(count: int, data: st.DataObject) -> None:
    index = data.draw(st.integers(0, count - 1))
    assert pick_index((index + 0.5) / count, count) == index
    assert (pick_index(0.0, count), pick_index(1.0, count)) == (0, count - 1)
