"""Intervals of bounded means, of rates and of their differences: exact, and by simulation."""

import math
from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from evoros.base.arrays import Array
from evoros.certificate.rates import (
    LOWER_SHARE,
    bound_difference,
    bound_mean,
    bound_rate,
    guess_highest,
)
from evoros.certificate.validation import find_least_width

SCORES = st.lists(st.integers(0, 100).map(float), min_size=1, max_size=20)
CONFIDENCES = st.sampled_from([0.5, 0.8, 0.95, 0.999])
ERROR = 5e-6
"""Of an interval within a range of 100: the integral is exact to 3e-8 of it, the ends to 1e-6."""


@given(st.integers(1, 200), st.data(), CONFIDENCES)
def test_of_successes_and_failures_it_is_clopper_and_pearsons(
    trials: int, data: st.DataObject, confidence: float
) -> None:
    successes = data.draw(st.integers(0, trials))
    scores = [1.0] * successes + [0.0] * (trials - successes)
    error, failures = 1 - confidence, trials - successes
    low = stats.beta.ppf(error * LOWER_SHARE, successes, failures + 1) if successes else 0.0
    high = stats.beta.isf(error * (1 - LOWER_SHARE), successes + 1, failures) if failures else 1.0
    assert bound_mean(scores, 0, 1, confidence) == pytest.approx((low, high), abs=2e-6)


def test_its_ends_are_quantiles_of_the_weighted_mean() -> None:
    rng = np.random.default_rng(0)
    scores, draws = rng.uniform(2, 7, 6), 200_000
    weights = rng.dirichlet(np.ones(7), draws)
    low, high = bound_mean(scores.tolist(), 1, 8, 0.95)
    for end, extreme, chance in ((low, 1.0, 0.04), (high, 8.0, 0.99)):
        below = float(np.mean(weights @ np.append(scores, extreme) <= end))
        assert below == pytest.approx(chance, abs=5 * math.sqrt(chance * (1 - chance) / draws))


@settings(max_examples=40)
@given(SCORES, CONFIDENCES, st.randoms(), st.integers(-50, 50), st.sampled_from([1e-6, 1.0, 1e6]))
def test_it_holds_the_mean_in_any_order_and_on_any_scale(
    scores: list[float], confidence: float, rng: object, shift: int, scale: float
) -> None:
    low, high = bound_mean(scores, 0, 100, confidence)
    assert 0 <= low <= np.mean(scores) + 1e-6
    assert np.mean(scores) - 1e-6 <= high <= 100
    assert bound_mean(sorted(scores), 0, 100, confidence) == (low, high)
    moved = [scale * (score + shift) for score in scores]
    ends = bound_mean(moved, scale * shift, scale * (100 + shift), confidence)
    wanted = [scale * (end + shift) for end in (low, high)]
    assert ends == pytest.approx(wanted, abs=ERROR * max(1.0, scale))


@settings(max_examples=40)
@given(SCORES, st.integers(2, 40))
def test_repeated_scores_count_as_further_ones(scores: list[float], repeats: int) -> None:
    wide, narrow = (bound_mean(scores, 0, 100, 0.95, count) for count in (1, repeats))
    assert narrow == pytest.approx(bound_mean(scores * repeats, 0, 100, 0.95), abs=ERROR)
    assert narrow[1] - narrow[0] <= wide[1] - wide[0] + 1e-5


@given(st.integers(1, 99), st.integers(1, 300), CONFIDENCES)
def test_no_scores_of_a_level_have_a_narrower_interval_than_equal_ones(
    level: int, count: int, confidence: float
) -> None:
    low, high = bound_mean([float(level)] * count, 0, 100, confidence)
    least = find_least_width((level, 100 - level), count, confidence)
    assert high - low == pytest.approx(least, abs=ERROR)


def test_without_scores_anything_is_possible() -> None:
    assert bound_mean([], 3, 24, 0.95) == (3, 24)


@given(SCORES)
def test_the_highest_score_is_as_far_above_the_best_as_the_best_above_the_median(
    scores: list[float],
) -> None:
    highest = guess_highest(scores, 0.0)
    assert highest >= max(scores)
    assert highest - max(scores) == pytest.approx(max(scores) - np.median(scores))
    assert guess_highest(scores, 200.0) == pytest.approx(400 - np.median(scores))


TIMES: dict[str, Callable[[np.random.Generator, tuple[int, int]], Array]] = {
    "normal": lambda rng, shape: rng.normal(380, 6, shape),
    "exponential": lambda rng, shape: 300 + rng.exponential(40, shape),
    "quick ones are rare": lambda rng, shape: np.where(rng.random(shape) < 0.02, 100.0, 380.0),
    "differ between worlds": lambda rng, shape: rng.normal([250, 330, 420], 5, shape),
}


def draw_missions(rng: np.random.Generator, rates: tuple[float, ...], times: str, n: int) -> Array:
    """Draw Eq. 1 (n, 3) of missions that are completed at these rates in three worlds."""
    shape = n, len(rates)
    left = 2 - np.clip(TIMES[times](rng, shape), 1, 540) / 540
    failed = (1 + rng.uniform(0, 0.9, shape)) ** 2
    return np.where(rng.random(shape) < np.array(rates), 4 + left**2, failed)


@pytest.mark.parametrize("times", TIMES)
@pytest.mark.parametrize("rates", [(0.8,) * 3, (0.99,) * 3, (1, 1, 1)])
def test_it_covers_the_mean_of_designs_that_rarely_fail(
    times: str, rates: tuple[float, ...]
) -> None:
    """An interval that covers 95 % fails once in a thousand tests."""
    rng, count = np.random.default_rng(3), 80
    mean = float(draw_missions(rng, rates, times, 100_000).mean())
    covered = 0
    for _ in range(count):
        scores = draw_missions(rng, rates, times, 5).ravel().tolist()
        low, high = bound_mean(scores, 1.0, 8.0, 0.95)
        covered += low <= mean <= high
    assert covered >= stats.binom.ppf(0.001, count, 0.95)


RATES = np.linspace(0, 1, 101)
ROUNDING = 1e-6


def list_chances(trials: int) -> Array:
    """Return the chance (rates, trials + 1) of each number of successes."""
    return np.asarray(stats.binom.pmf(np.arange(trials + 1), trials, RATES[:, np.newaxis]))


@pytest.mark.parametrize("confidence", [0.8, 0.95, 0.99])
def test_the_interval_of_a_rate_covers_whatever_the_rate(confidence: float) -> None:
    rates = RATES[:, np.newaxis]
    for trials in range(1, 31):
        bounds = [bound_rate(successes, trials, confidence) for successes in range(trials + 1)]
        low, high = np.array(bounds).T
        inside = (low - ROUNDING <= rates) & (rates <= high + ROUNDING)
        assert ((list_chances(trials) * inside).sum(axis=1) >= confidence).all(), trials


@pytest.mark.parametrize(("m", "n"), [(2, 2), (5, 5), (10, 10), (5, 20), (2, 40)])
def test_the_interval_of_a_difference_covers_whatever_the_rates(m: int, n: int) -> None:
    inside = np.zeros((len(RATES), len(RATES)))
    differences = RATES[:, np.newaxis] - RATES
    first, second = list_chances(m), list_chances(n)
    for a, b in product(range(m + 1), range(n + 1)):
        low, high = bound_difference((a, m), (b, n), 0.95)
        covers = (low - ROUNDING <= differences) & (differences <= high + ROUNDING)
        inside += covers * np.outer(first[:, a], second[:, b])
    assert inside.min() >= 0.95


@given(st.integers(1, 40), st.integers(1, 40), st.data())
def test_a_difference_is_shown_where_fishers_test_shows_it(
    m: int, n: int, data: st.DataObject
) -> None:
    a, b = data.draw(st.integers(0, m)), data.draw(st.integers(0, n))
    low, _ = bound_difference((a, m), (b, n), 0.95)
    p = stats.fisher_exact([[a, m - a], [b, n - b]], "greater").pvalue
    assert (low > 0) == (p < 0.025) or abs(low) < 1e-5


@given(st.integers(1, 300), st.data())
def test_the_ends_are_the_rates_that_an_exact_test_just_does_not_refuse(
    trials: int, data: st.DataObject
) -> None:
    successes = data.draw(st.integers(0, trials))
    low, high = bound_rate(successes, trials, 0.95)
    if successes:
        assert stats.binom.sf(successes - 1, trials, low) == pytest.approx(0.025, rel=0.01)
    if successes < trials:
        assert stats.binom.cdf(successes, trials, high) == pytest.approx(0.025, rel=0.01)
    assert bound_rate(trials - successes, trials, 0.95) == pytest.approx((1 - high, 1 - low))


@given(st.integers(1, 40), st.integers(1, 40), st.data())
def test_a_difference_turns_with_its_rates_and_ends_at_one(
    m: int, n: int, data: st.DataObject
) -> None:
    first, second = (data.draw(st.integers(0, m)), m), (data.draw(st.integers(0, n)), n)
    low, high = bound_difference(first, second, 0.95)
    assert bound_difference(second, first, 0.95) == pytest.approx((-high, -low))
    assert -1 <= low <= first[0] / m - second[0] / n <= high <= 1


def test_the_difference_from_a_known_rate_is_the_interval_of_the_other() -> None:
    assert bound_difference((3, 40), (0, 10**7), 0.95) == pytest.approx(
        bound_rate(3, 40, 0.95), abs=1e-5
    )


def test_without_trials_there_is_no_interval() -> None:
    assert all(map(math.isnan, bound_rate(0, 0, 0.95)))
