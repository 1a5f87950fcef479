"""The study of README.md: what a search reaches within a budget, its intervals and tables."""

import barn
import barn_tables
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evoros.base.arrays import Array

scores = arrays(np.float64, 5, elements=st.floats(0, 0.5), unique=True)
prices = st.lists(st.integers(1, 700), min_size=1, max_size=6, unique=True)


@given(st.lists(prices, min_size=1, max_size=5), st.integers(0, 800))
def test_a_budget_buys_the_dearest_design_of_each_front(
    fronts: list[list[int]], budget: int
) -> None:
    frames = [pd.DataFrame({"price": sorted([0, *front])}) for front in fronts]
    chosen = barn_tables.choose(frames, float(budget))
    assert list(chosen["price"]) == [
        max(price for price in [0, *front] if price <= budget) for front in fronts
    ]


@settings(deadline=None)
@given(scores, scores)
def test_a_comparison_is_antisymmetric(one: Array, other: Array) -> None:
    for paired in (True, False):
        (forth, p), (back, same) = (
            barn_tables.compare(*pair, paired) for pair in ((one, other), (other, one))
        )
        assert (-back).value == pytest.approx(forth.value)
        assert ((-back).low, (-back).high) == pytest.approx((forth.low, forth.high), nan_ok=True)
        assert p == pytest.approx(same, nan_ok=True)


def test_the_interval_of_searches_is_students() -> None:
    interval = barn_tables.student(np.array([1.0, 2.0, 3.0, 4.0, 5.0]))
    half = 2.7764 * np.sqrt(2.5 / 5)  # the 97.5 % quantile of t with 4 degrees of freedom
    assert (interval.low, interval.high) == pytest.approx((3 - half, 3 + half), abs=1e-4)


def test_searches_that_do_not_differ_are_told_so() -> None:
    same = np.array([0.1, 0.2, 0.3])
    assert barn_tables.compare(same, same, paired=True)[1] == 1.0


tables = st.dictionaries(
    st.sampled_from(["one", "two"]), st.text("|-ab 1\n", min_size=1).map(str.strip)
)


@given(tables)
def test_tables_fill_their_marks_and_nothing_else(tables: dict[str, str]) -> None:
    marks = "<!-- measured: {} -->\n\n{}\n\n<!-- end -->"
    page = (
        "\nhead\n"
        + "\nbetween\n".join(marks.format(name, "old") for name in ("one", "two"))
        + "\ntail"
    )
    filled = barn_tables.fill(page, tables)
    for name in ("one", "two"):
        assert marks.format(name, tables.get(name, "old")) in filled
    assert barn_tables.fill(page, {"without marks": "new"}) == page
    assert barn_tables.fill(filled, dict.fromkeys(("one", "two"), "old")) == page


designs = st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=12)


@given(designs)
def test_each_design_of_a_front_is_above_all_that_cost_no_more(
    pairs: list[tuple[int, int]],
) -> None:
    missions = {
        i: pd.DataFrame({"price": [price], "score": [score]})
        for i, (price, score) in enumerate(pairs)
    }
    front = barn.list_front(barn_tables.summarize(missions))
    best = max(score for _, score in pairs)
    assert [pairs[one] for one in front] == sorted({pairs[one] for one in front})
    assert pairs[front[-1]][1] == best
    for one in front:
        cheaper = [score for price, score in pairs if price <= pairs[one][0]]
        assert pairs[one][1] == max(cheaper)
