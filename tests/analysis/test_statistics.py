"""Statistics against published tables, worked examples, exact distributions and their own laws."""

import math
from collections.abc import Callable
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
    Sample,
    holm,
    mean_interval,
    median_interval,
    ratio_interval,
    share_interval,
    spearman,
)
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


@pytest.mark.parametrize(("m", "n"), [(5, 5), (6, 6), (10, 10)])
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
