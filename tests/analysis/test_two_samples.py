"""The test of two samples and the interval of A12: enumeration, symmetries, levels, coverage."""

import math
from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from evoros.analysis.statistics.small_samples import LEVEL, Sample
from evoros.analysis.statistics.two_samples import (
    MAX_PERMUTED,
    MIN_VALUES,
    a12,
    a12_interval,
    brunner_munzel,
    compute_statistics,
    find_critical,
    minimum_p,
    minimum_replicates,
)
from evoros.base.arrays import Array

SAMPLES = st.lists(st.integers(0, 6).map(float), min_size=1, max_size=6)
TESTED = st.lists(st.integers(0, 9).map(float), min_size=5, max_size=5)


def measure_error(x: Array, y: Array) -> float:
    """Return the standard error of A12 by Brunner and Munzel."""
    above = (x[:, None] > y) + 0.5 * (x[:, None] == y)
    parts = (above.mean(axis=axis).var(ddof=1) / above.shape[1 - axis] for axis in (0, 1))
    return math.sqrt(sum(parts))


def logit_statistic(x: Array, y: Array) -> float:
    """Return the logit of A12 over its error, as if the nearest separated values were tied."""
    share, error = a12(x, y), measure_error(x, y)
    if error == 0:
        pairs = 2 * x.size * y.size
        return float(np.sign(share - 0.5)) * math.log(pairs - 1) * (1 - 1 / pairs) / math.sqrt(2)
    return math.log(share / (1 - share)) * share * (1 - share) / error


def test_the_error_is_that_of_scipy() -> None:
    rng = np.random.default_rng(1)
    x, y = rng.integers(0, 9, 12).astype(float), rng.integers(2, 9, 7).astype(float)
    statistic = (0.5 - a12(x, y)) / measure_error(x, y)
    assert statistic == pytest.approx(stats.brunnermunzel(x, y).statistic)


@settings(max_examples=20, deadline=None)
@given(TESTED, TESTED)
def test_p_is_the_share_of_all_splits_that_are_as_extreme(x: list[float], y: list[float]) -> None:
    pooled, observed = np.array([*x, *y]), logit_statistic(np.array(x), np.array(y))
    others = []
    for chosen in combinations(range(len(pooled)), len(x)):
        mask = np.isin(range(len(pooled)), chosen)
        others.append(logit_statistic(pooled[mask], pooled[~mask]))
    tails = (
        np.mean(np.array(others) >= observed - 1e-9),
        np.mean(np.array(others) <= observed + 1e-9),
    )
    assert brunner_munzel(x, y) == pytest.approx(min(1.0, 2 * min(tails)))


@given(SAMPLES, SAMPLES, st.integers(0, 10**6))
def test_neither_order_nor_names_nor_scale_matter(
    x: list[float], y: list[float], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    one, other = a12_interval(x, y), a12_interval(y, x)
    grown = np.exp(rng.permutation(x)), np.exp(rng.permutation(y))
    assert 0 <= one.low <= one.value <= one.high <= 1
    assert one.high > one.low
    assert one.value == a12(x, y) == pytest.approx(1 - a12(y, x))
    assert (1 - one.high, 1 - one.low) == pytest.approx((other.low, other.high))
    assert a12_interval(*grown) == one
    assert brunner_munzel(*grown) == brunner_munzel(x, y) == brunner_munzel(y, x)


def test_samples_whose_splits_are_drawn_have_the_same_symmetries() -> None:
    rng = np.random.default_rng(2)
    x, y = rng.standard_normal(10), rng.standard_normal(15) + 0.8
    p = brunner_munzel(x, y)
    assert 0.001 < p < 1
    assert brunner_munzel(np.exp(y[::-1]), np.exp(x)) == p


SHAPES: dict[str, Callable[[np.random.Generator, int], Array]] = {
    "normal": lambda rng, n: rng.standard_normal(n),
    "two modes": lambda rng, n: rng.choice([-1.0, 1.0], n) + 0.3 * rng.standard_normal(n),
}
UNEQUAL = [(10, 30, 1, 5), (10, 30, 5, 1), (5, 20, 1, 5), (5, 20, 5, 1), (12, 12, 1, 5)]
PAIRS = 400


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("m", "n", "first", "second"), UNEQUAL)
def test_the_level_is_kept_and_a12_covered_at_unequal_size_and_spread(
    shape: str, m: int, n: int, first: float, second: float
) -> None:
    """Both distributions are symmetric about 0, so that A12 is 0.5."""
    rng, draw = np.random.default_rng(3), SHAPES[shape]
    pairs = [(first * draw(rng, m), second * draw(rng, n)) for _ in range(PAIRS)]
    wrong = sum(brunner_munzel(*pair) < LEVEL for pair in pairs)
    missed = sum(not one.low <= 0.5 <= one.high for one in (a12_interval(*pair) for pair in pairs))
    limit = stats.binom.ppf(0.999, PAIRS, LEVEL)
    assert missed <= wrong <= limit


@pytest.mark.parametrize("difference", [1.0, 3.0])
def test_an_a12_far_from_a_half_is_covered(difference: float) -> None:
    rng = np.random.default_rng(5)
    true = stats.norm.cdf(difference / np.sqrt(2))
    pairs = [(rng.standard_normal(6) + difference, rng.standard_normal(9)) for _ in range(PAIRS)]
    missed = sum(not one.low <= true <= one.high for one in (a12_interval(*pair) for pair in pairs))
    assert missed <= stats.binom.ppf(0.999, PAIRS, LEVEL)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.integers(6, 8), st.sampled_from([6, 7, 12]))
def test_the_interval_excludes_a_half_as_the_test_does(seed: int, m: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = rng.standard_normal(m) + rng.choice([0.0, 1.0, 4.0]), rng.standard_normal(n)
    interval, p = a12_interval(x, y), brunner_munzel(x, y)
    if abs(p - LEVEL) > 1e-9:
        assert (p < LEVEL) == (interval.low > 0.5 + 1e-9 or interval.high < 0.5 - 1e-9)


def test_samples_too_large_to_permute_have_nearly_the_same_p_and_interval() -> None:
    rng = np.random.default_rng(6)
    x, y = rng.standard_normal(100) + 0.25, 2 * rng.standard_normal(MAX_PERMUTED - 100)
    more = np.append(y, 0.0)
    assert brunner_munzel(x, more) == pytest.approx(brunner_munzel(x, y), abs=0.02)
    one, other = a12_interval(x, y), a12_interval(x, more)
    assert (one.low, one.high) == pytest.approx((other.low, other.high), abs=0.01)


def test_many_pairs_have_the_statistic_of_each() -> None:
    rng = np.random.default_rng(7)
    x, y = rng.standard_normal((9, 6)), rng.standard_normal((9, 8)) + 1
    expected = [logit_statistic(*pair) for pair in zip(x, y, strict=True)]
    assert compute_statistics(x, y) == pytest.approx(expected)
    for n in (6, 12):  # enumerated, and drawn
        low, high = find_critical(n, LEVEL)
        samples = rng.standard_normal((40, n)), rng.standard_normal((40, n)) + 1
        statistics = compute_statistics(*samples)
        p = np.array([brunner_munzel(*pair) for pair in zip(*samples, strict=True)])
        assert ((statistics < low) | (statistics > high)).tolist() == (p < LEVEL).tolist()


def test_a12_by_hand() -> None:
    """Pairs (3, 1), (3, 2) are greater, (2, 2) is equal, (2, 1) is greater: 3.5 of 4."""
    assert a12([3, 2], [1, 2]) == 3.5 / 4
    assert a12([1], [1]) == 0.5
    assert a12([2, 3], [0, 1]) == 1.0


@pytest.mark.parametrize(("k", "low"), [(5, 0.478), (10, 0.692), (30, 0.884)])
def test_a_complete_separation_bounds_a12_as_independent_pairs_do(k: int, low: float) -> None:
    """Clopper and Pearson's lower bound of a share of which k of k were true."""
    x, y = np.arange(k) + 100.0, np.arange(k + 3.0)
    assert a12_interval(x, y).low == pytest.approx(low, abs=5e-4)
    bound = stats.binomtest(k, k).proportion_ci(1 - LEVEL, method="exact").low
    assert a12_interval(x, y).low == pytest.approx(bound)
    same = a12_interval([2.0] * k, [2.0] * k)
    assert (same.low, same.value, same.high) == pytest.approx((bound / 2, 0.5, 1 - bound / 2))


@pytest.mark.parametrize(("m", "n"), [(1, 1), (4, 30), (5, 5), (5, 20), (12, 12)])
def test_the_minimum_p_is_that_of_samples_that_do_not_overlap(m: int, n: int) -> None:
    assert minimum_p(m, n) == pytest.approx(brunner_munzel(range(m), range(100, 100 + n)))


def test_replicates_that_are_needed_by_hand() -> None:
    """2 / C(2n, n): 1/126 of 5, 1/462 of 6, 1/1716 of 7."""
    needed: list[int] = [minimum_replicates(count) for count in (1, 6, 7, 23, 24)]
    assert needed == [MIN_VALUES, 5, 6, 6, 7]


def test_four_values_against_many_show_nothing() -> None:
    few: Sample = [9.0, 9.1, 9.2, 9.3]
    assert brunner_munzel(few, range(5)) == 1.0


@pytest.mark.parametrize(("m", "n"), [(5, 5), (6, 6), (8, 8), (10, 10), (5, 20)])
def test_a12_of_two_values_is_covered_exactly(m: int, n: int) -> None:
    """All pairs of samples of two values are enumerated, with their binomial chances."""
    ends = {
        (i, j): a12_interval([1.0] * i + [0.0] * (m - i), [1.0] * j + [0.0] * (n - j))
        for i in range(m + 1)
        for j in range(n + 1)
    }
    for p, q in ((1.0, 0.5), (0.95, 0.5), (0.9, 0.5), (0.7, 0.3), (0.99, 0.8), (0.9, 0.9)):
        value = 0.5 + (p - q) / 2
        covered = sum(
            stats.binom.pmf(i, m, p) * stats.binom.pmf(j, n, q)
            for (i, j), interval in ends.items()
            if interval.low <= value <= interval.high
        )
        assert covered >= 0.94
