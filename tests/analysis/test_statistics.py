"""Statistics against published tables, worked examples, exact distributions and their own laws."""

import math
from itertools import combinations
from math import comb, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from evoros.analysis.statistics.small_samples import (
    LEVEL,
    Interval,
    a12,
    holm,
    magnitude,
    mann_whitney,
    mean_interval,
    median_interval,
    minimum_p,
    minimum_replicates,
    ratio_interval,
    share_interval,
    spearman,
)

SAMPLES = st.lists(st.integers(0, 6).map(float), min_size=1, max_size=6)
PS = st.lists(st.floats(0, 1), min_size=1, max_size=8)

# Critical values of U, two-sided at the 5 % level, as in the tables of most textbooks.
CRITICAL = [
    (4, 4, 0),
    (3, 5, 0),
    (5, 5, 2),
    (6, 6, 5),
    (7, 7, 8),
    (8, 8, 13),
    (9, 9, 17),
    (10, 10, 23),
    (10, 20, 55),
    (15, 15, 64),
    (20, 20, 127),
]


def with_u(m: int, n: int, u: int) -> tuple[list[float], list[float]]:
    """Two samples without equal values of which ``u`` pairs have the greater value in the first."""
    whole, rest = divmod(u, n)
    above = [n] * whole + [rest] + [0] * (m - whole - 1)  # values of y below each value of x
    return [count - 0.5 + i / (2 * m) for i, count in enumerate(above)], list(map(float, range(n)))


@pytest.mark.parametrize(("m", "n", "critical"), CRITICAL)
def test_the_test_rejects_where_the_tables_do_and_not_beyond(m: int, n: int, critical: int) -> None:
    assert a12(*with_u(m, n, critical)) == pytest.approx(critical / (m * n))
    assert (
        mann_whitney(*with_u(m, n, critical)) <= LEVEL < mann_whitney(*with_u(m, n, critical + 1))
    )


@given(SAMPLES, SAMPLES)
def test_small_samples_are_tested_exactly_even_with_equal_values(
    x: list[float], y: list[float]
) -> None:
    """Against all ways to give the pooled values to the two samples, counted one by one."""
    if len(x) + len(y) > 9:
        x, y = x[:4], y[:5]
    pooled, u = np.array([*x, *y]), a12(x, y)
    others = []
    for chosen in combinations(range(len(pooled)), len(x)):
        mask = np.zeros(len(pooled), bool)
        mask[list(chosen)] = True
        others.append(a12(pooled[mask], pooled[~mask]))
    low, high = (np.mean(np.array(others) <= u + 1e-9), np.mean(np.array(others) >= u - 1e-9))
    assert mann_whitney(x, y) == pytest.approx(min(1.0, 2 * min(low, high)))


def test_three_replicates_show_nothing_though_the_approximation_would_say_so() -> None:
    same = [1.0] * 3, [2.0] * 3
    assert stats.mannwhitneyu(*same, method="asymptotic").pvalue < LEVEL
    assert mann_whitney(*same) == pytest.approx(0.1)


def test_large_samples_with_equal_values_are_those_of_scipy() -> None:
    x, y = [float(i % 7) for i in range(40)], [float(i % 9) for i in range(30)]
    assert mann_whitney(x, y) == stats.mannwhitneyu(x, y).pvalue


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


# A12 ----------------------------------------------------------------------------------------


def test_a12_by_hand() -> None:
    """Pairs (3, 1), (3, 2) are greater, (2, 2) is equal, (2, 1) is greater: 3.5 of 4."""
    assert a12([3, 2], [1, 2]) == 3.5 / 4
    assert a12([1], [1]) == 0.5
    assert a12([2, 3], [0, 1]) == 1.0


@given(SAMPLES, SAMPLES)
def test_a12_has_its_symmetries(x: list[float], y: list[float]) -> None:
    assert a12(x, y) + a12(y, x) == pytest.approx(1.0)
    assert a12(x, x) == pytest.approx(0.5)
    assert a12([math.exp(v) for v in x], [math.exp(v) for v in y]) == a12(x, y)
    assert magnitude(a12(x, y)) == magnitude(a12(y, x))
    u = stats.mannwhitneyu(x, y, method="asymptotic").statistic
    assert a12(x, y) == pytest.approx(u / (len(x) * len(y)))


@pytest.mark.parametrize(
    ("effect", "name"),
    [
        (0.5, "negligible"),
        (0.559, "negligible"),
        (0.56, "small"),
        (0.44, "small"),
        (0.64, "medium"),
        (0.36, "medium"),
        (0.71, "large"),
        (0.29, "large"),
        (0.0, "large"),
    ],
)
def test_magnitudes_are_those_of_the_paper(effect: float, name: str) -> None:
    assert magnitude(effect) == name


# Intervals ----------------------------------------------------------------------------------


def test_the_interval_of_a_median_is_the_quantile_of_its_known_distribution() -> None:
    """The bootstrapped median of an odd number of values has a known distribution (Efron 1979).

    It exceeds the k-th smallest where less than half of the draws fall among the k smallest.
    """
    values = np.arange(13.0)
    beyond = stats.binom.cdf(6, 13, np.arange(1, 14) / 13)  # P(median > k-th smallest)
    low, high = (int(np.argmax(1 - beyond >= q)) for q in (LEVEL / 2, 1 - LEVEL / 2))
    assert median_interval(values) == Interval(6.0, low, high)


def test_an_interval_is_that_of_scipy() -> None:
    values = np.random.default_rng(1).normal(size=20)
    beyond = stats.norm.sf(math.sqrt(20 / 19) * stats.t.ppf(0.975, 19))  # Hesterberg 2015
    for mine, statistic, tail in (
        (median_interval, np.median, 0.025),
        (mean_interval, np.mean, beyond),
    ):
        rng = np.random.default_rng(20181)
        theirs = stats.bootstrap(
            (values,),
            statistic,
            confidence_level=1 - 2 * tail,
            method="percentile",
            n_resamples=9999,
            rng=rng,
        ).confidence_interval
        one = mine(values)
        assert one.value == statistic(values)
        assert (one.low, one.high) == pytest.approx((theirs.low, theirs.high), rel=1e-12)


@pytest.mark.slow
def test_the_interval_covers_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(5)
    within = [
        (one := median_interval(rng.exponential(size=15))).low <= math.log(2) <= one.high
        for _ in range(200)
    ]
    assert 0.89 <= np.mean(within) <= 0.99


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
    x = [1.0, 2.0, 5.0, 9.0]
    one, other = spearman(x, np.exp(x)), spearman(x, np.negative(x))
    assert (one.value, one.low, one.high) == pytest.approx((1.0, 1.0, 1.0))
    assert (other.value, other.low, other.high) == pytest.approx((-1.0, -1.0, -1.0))
    assert math.isnan(spearman(x, [3.0] * 4).value)


def test_a_share_and_the_ends_of_wilsons_formula() -> None:
    z, n, p = stats.norm.ppf(0.975), 10, 0.6
    centre, half = p + z * z / (2 * n), z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    one = share_interval(6, 10)
    assert one.value == p
    assert (one.low, one.high) == pytest.approx(
        ((centre - half) / (1 + z * z / n), (centre + half) / (1 + z * z / n))
    )
    assert math.isnan(share_interval(0, 0).value)


# Too few ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("m", "n"), [(1, 1), (2, 3), (4, 4), (5, 5), (3, 10)])
def test_the_least_p_is_that_of_samples_that_do_not_overlap(m: int, n: int) -> None:
    assert minimum_p(m, n) == pytest.approx(mann_whitney(range(m), range(100, 100 + n)))


def test_replicates_that_are_needed_by_hand() -> None:
    """2 / C(2n, n): 1/10 of 3, 1/35 of 4, 1/126 of 5, 1/462 of 6."""
    assert [minimum_replicates(count) for count in (1, 2, 3, 6, 7, 23, 24)] == [4, 5, 5, 5, 6, 6, 7]
    assert 2 / comb(6, 3) == 0.1


@pytest.mark.slow
def test_only_very_large_samples_get_the_approximation() -> None:
    rng = np.random.default_rng(3)
    x, y = rng.normal(0.3, 1.0, 60), rng.normal(0.0, 1.0, 1800)  # exactly: 20 s
    rough = stats.mannwhitneyu(x, y, method="asymptotic").pvalue
    assert mann_whitney(x, y) == pytest.approx(rough, rel=1e-12)
    exact = stats.mannwhitneyu(x[:30], y[:900], method="exact").pvalue
    assert mann_whitney(x[:30], y[:900]) == pytest.approx(exact, rel=1e-12)
