"""Statistics against published tables, worked examples, exact distributions and their own laws."""

import math
from itertools import combinations
from math import nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from evoros.analysis.statistics.small_samples import (
    LEVEL,
    Interval,
    holm,
    mean_interval,
    median_interval,
    ratio_interval,
    share_interval,
    spearman,
)

PS = st.lists(st.floats(0, 1), min_size=1, max_size=8)

# Holm ---------------------------------------------------------------------------------------


def test_a_worked_example() -> None:
    """The example in the documentation of pingouin's function of the same name (Vallat 2018)."""
    adjusted = holm([0.50, 0.003, 0.32, 0.054, 0.0003])
    assert adjusted == pytest.approx([0.64, 0.012, 0.64, 0.162, 0.0015])


@given(PS)
def test_adjusting_is_testing_all_that_could_be_true_together(p: list[float]) -> None:
    """Holm's procedure closes Bonferroni's: every set of hypotheses with the one in it."""
    for i, adjusted in enumerate(holm(p)):
        sets = (s for size in range(1, len(p) + 1) for s in combinations(range(len(p)), size))
        worst = max(len(s) * min(p[k] for k in s) for s in sets if i in s)
        assert adjusted == pytest.approx(min(1.0, worst))


@given(PS)
def test_adjusted_p_keep_their_order_and_lie_between_raw_and_bonferroni(p: list[float]) -> None:
    adjusted = holm(p)
    for raw, one in zip(p, adjusted, strict=True):
        assert raw <= one <= min(1.0, len(p) * raw) + 1e-12
    order = np.argsort(p, kind="stable")
    assert list(np.array(adjusted)[order]) == sorted(adjusted)
    assert holm(p[::-1]) == pytest.approx(adjusted[::-1])


def test_nothing_to_adjust() -> None:
    assert holm([]) == []
    assert holm([0.04]) == [0.04]


# Intervals ----------------------------------------------------------------------------------


@given(st.lists(st.integers(-9, 9), min_size=6, max_size=40))
def test_the_interval_of_a_median_is_that_of_scipy(values: list[int]) -> None:
    theirs = stats.quantile_test(values).confidence_interval(1 - LEVEL)
    assert median_interval(values) == Interval(np.median(values), theirs.low, theirs.high)


@pytest.mark.parametrize("n", [2, 3, 4, 5])
def test_the_range_of_too_few_values_says_how_often_it_contains_the_median(n: int) -> None:
    """It misses a median that all n values exceed, or none."""
    values = np.arange(n, dtype=float)
    interval = median_interval(values)
    assert (interval.low, interval.high) == (0.0, n - 1)
    assert interval.confidence == pytest.approx(1 - 2 / 2**n)
    assert interval.write(".0f").endswith(f"[0, {n - 1}; {100 * (1 - 2 / 2**n):.0f} %]")


def test_an_interval_is_that_of_scipy() -> None:
    values = np.random.default_rng(1).normal(size=20)
    beyond = stats.norm.sf(math.sqrt(20 / 19) * stats.t.ppf(0.975, 19))  # Hesterberg 2015
    theirs = stats.bootstrap(
        (values,),
        np.mean,
        confidence_level=1 - 2 * beyond,
        method="percentile",
        n_resamples=9999,
        rng=np.random.default_rng(20181),
    ).confidence_interval
    one = mean_interval(values)
    assert one.value == np.mean(values)
    assert (one.low, one.high) == pytest.approx((theirs.low, theirs.high), rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("n", [6, 10])
def test_few_values_are_enough_for_the_interval_of_a_mean_or_ratio(n: int) -> None:
    rng, covered = np.random.default_rng(n), []
    for _ in range(400):
        mean, wholes = mean_interval(rng.normal(size=n)), rng.gamma(4.0, size=n)
        ratio = ratio_interval(rng.normal(0.5, 0.3, n) * wholes, wholes)
        covered.append((mean.low <= 0.0 <= mean.high, ratio.low <= 0.5 <= ratio.high))
    # 92.5 and 95 %, with three standard errors; without the expansion, 84 and 90 %.
    assert (np.mean(covered, axis=0) >= (0.885 if n == 6 else 0.917)).all()


def test_one_value_has_no_interval() -> None:
    assert str(median_interval([2.0])) == str(Interval(2.0, nan, nan))
    assert str(median_interval([])) == str(Interval(nan, nan, nan))
    assert str(spearman([1.0], [2.0])) == str(Interval(nan, nan, nan))


@settings(max_examples=30)
@given(st.lists(st.integers(0, 9), min_size=3, max_size=12, unique=True))
def test_the_rank_correlation_is_that_of_scipy(x: list[int]) -> None:
    y = [(7 * value) % 5 for value in x]
    expected = nan if len(set(y)) == 1 else stats.spearmanr(x, y).statistic
    assert spearman(x, y).value == pytest.approx(expected, nan_ok=True)


def test_a_perfect_order_has_no_doubt_and_a_constant_side_no_correlation() -> None:
    x = np.arange(1.0, 11.0) ** 2
    one, other = spearman(x, np.exp(x)), spearman(x, np.negative(x))
    assert (one.value, one.low, one.high) == pytest.approx((1.0, 1.0, 1.0))
    assert (other.value, other.low, other.high) == pytest.approx((-1.0, -1.0, -1.0))
    assert math.isnan(spearman(x, [3.0] * 10).value)
    assert math.isnan(spearman(x[:9], x[:9]).low)


def test_a_share_has_the_exact_interval_and_none_of_nothing() -> None:
    exact = stats.binomtest(6, 10).proportion_ci(method="exact")
    one = share_interval(6, 10)
    assert (one.value, one.low, one.high) == pytest.approx((0.6, exact.low, exact.high), abs=1e-6)
    assert math.isnan(share_interval(0, 0).value)
