"""Bets show what they may, at their error rate, which is computed exactly."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoros.requirement.bets import BETS, bound_from_below, count_to_proof, estimate_further

CONFIDENCE = 0.95
VALUES = st.lists(st.floats(0, 1), max_size=60).map(np.array)
LIMITS = st.floats(0.01, 0.99)


def chance_of_proof(rate: float, limit: float, most: int) -> float:
    """The exact chance that successes at a rate show within so many trials that it is higher.

    The capital depends on the number of successes alone, so that its states are a line.
    """
    alive, proven = np.array([1.0]), 0.0
    for count in range(1, most + 1):
        reached = np.zeros(count + 1)
        reached[1:] += alive * rate
        reached[:-1] += alive * (1 - rate)
        won = np.arange(count + 1)
        with np.errstate(all="ignore"):
            capital = sum(
                part
                * (1 + share * (1 / limit - 1)) ** won
                * np.where(share < 1, 1 - share, 0.0) ** (count - won)
                for share, part in BETS
            )
        proof = capital >= 1 / (1 - CONFIDENCE)
        proven += reached[proof].sum()
        alive = np.where(proof, 0.0, reached)
    return float(proven)


@pytest.mark.parametrize("limit", [0.05, 0.5, 0.8, 0.95, 0.99])
def test_a_rate_at_the_limit_is_rarely_shown_to_exceed_it(limit: float) -> None:
    wrong = chance_of_proof(limit, limit, 1000)
    assert 0.01 < wrong <= 1 - CONFIDENCE


def test_a_clear_yes_takes_tens_of_trials_and_a_clear_no_fewer() -> None:
    ones = np.ones(1000)
    assert count_to_proof(ones, 0.95, CONFIDENCE) < 80  # 59 are the fewest of any test
    assert chance_of_proof(0.99, 0.95, 300) > 0.9
    assert chance_of_proof(1 - 0.5, 1 - 0.95, 30) > 0.99  # that half is less than 0.95


@given(st.lists(st.booleans(), min_size=1, max_size=40), st.sampled_from([0.25, 0.5, 0.75]))
def test_the_capital_is_that_of_exact_arithmetic(won: list[bool], limit: float) -> None:
    """The limits are binary fractions, so that odds are exact."""
    capitals, expected = [Fraction(1)] * len(BETS), 0
    for count, one in enumerate(won, 1):
        gain = (1 if one else 0) / Fraction(limit) - 1
        capitals = [
            capital * (1 + Fraction(share) * gain)
            for capital, (share, _) in zip(capitals, BETS, strict=True)
        ]
        total = sum(
            capital * Fraction(part) for capital, (_, part) in zip(capitals, BETS, strict=True)
        )
        if total >= 1 / (1 - Fraction(CONFIDENCE)):
            expected = count
            break
    assert count_to_proof(np.array(won, dtype=float), limit, CONFIDENCE) == expected


@given(VALUES, LIMITS)
def test_the_bound_is_where_proofs_end(values: np.ndarray, limit: float) -> None:
    bound = bound_from_below(values, CONFIDENCE)
    assert 0 <= bound <= 1
    if abs(limit - bound) > 1e-5:
        assert (count_to_proof(values, limit, CONFIDENCE) > 0) == (limit < bound)


@given(VALUES, st.lists(st.floats(0, 1), max_size=20), LIMITS)
def test_a_proof_stands_whatever_follows(
    values: np.ndarray, more: list[float], limit: float
) -> None:
    count = count_to_proof(values, limit, CONFIDENCE)
    if count:
        again = np.concatenate([values[:count], more])
        assert count_to_proof(again, limit, CONFIDENCE) == count


def test_the_capital_is_shared_among_bets_that_can_be_paid() -> None:
    assert sum(part for _, part in BETS) == pytest.approx(1, abs=1e-12)
    assert all(0 < share <= 1 for share, _ in BETS)


@given(st.integers(1, 40), st.floats(0.1, 1), LIMITS)
def test_the_estimate_is_exact_if_further_values_are_the_same(
    seen: int, value: float, limit: float
) -> None:
    count = count_to_proof(np.full(300, value), limit, CONFIDENCE)
    if seen < count:
        assert estimate_further(np.full(seen, value), limit, CONFIDENCE) == count - seen


@given(st.lists(st.floats(0, 1), min_size=1, max_size=30))
def test_a_mean_at_the_limit_is_never_estimated_to_be_decided(values: list[float]) -> None:
    seen = np.array([*values, 0.2, 0.7])
    mean = float(seen.mean())
    assert estimate_further(seen, mean, CONFIDENCE) == math.inf
    assert estimate_further(1 - seen, 1 - mean, CONFIDENCE) == math.inf


def test_half_of_all_proofs_take_no_more_than_the_estimate() -> None:
    """Of 300 series of completions, each continued as long as the estimate from its rate says."""
    luck = np.random.default_rng(4)
    seen = np.repeat([0.0, 1.0], [7, 93])
    assert not count_to_proof(seen, 0.88, CONFIDENCE)
    further = int(estimate_further(seen, 0.88, CONFIDENCE))
    series = [np.concatenate([seen, luck.random(further) < 0.93]) for _ in range(300)]
    shown = sum(count_to_proof(values, 0.88, CONFIDENCE) > 0 for values in series)
    assert 0.5 <= shown / 300 <= 0.9
