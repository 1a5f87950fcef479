"""The intervals of a rate and of the difference of two, by all results that there can be."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from evoros.base.arrays import Array
from evoros.certificate.rates import bound_difference, bound_rate

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
