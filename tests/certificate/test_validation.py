"""The intervals of a certificate, against their definitions and by simulation."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from evoros.base.errors import InputError
from evoros.certificate.validation import Validation, combine_chances, compute_chance

SCORES = st.lists(st.integers(-90, 90).map(float), min_size=2, max_size=30)


@given(st.integers(1, 300), st.data())
def test_wilsons_interval_is_that_of_the_score_test(trials: int, data: st.DataObject) -> None:
    """Its ends are the rates that a z-test just does not refuse; it is symmetric."""
    successes = data.draw(st.integers(0, trials))
    low, high = Validation().bound_rate(successes, trials)
    assert 0 <= low <= successes / trials + 1e-6
    assert successes / trials - 1e-6 <= high <= 1
    for end in (low, high):
        if 1e-4 < end < 1 - 1e-4:
            z = abs(successes / trials - end) / math.sqrt(end * (1 - end) / trials)
            assert z == pytest.approx(1.959964, abs=0.02)
    mirrored = Validation().bound_rate(trials - successes, trials)
    assert (1 - mirrored[1], 1 - mirrored[0]) == pytest.approx((low, high), abs=2e-6)


@given(SCORES)
def test_the_interval_of_one_stage_is_students(scores: list[float]) -> None:
    low, high = Validation().bound_mean(scores, len(scores))
    centre, spread = float(np.mean(scores)), stats.sem(scores)
    half_width = float(spread * stats.t.ppf(0.975, len(scores) - 1))
    assert (low, high) == pytest.approx((centre - half_width, centre + half_width), abs=2e-6)


def test_two_stages_hold_their_confidence_and_their_precision() -> None:
    """The number of trials depends on the scores; stopping at any short interval would not do."""
    rng, validation = np.random.default_rng(0), Validation(precision=0.5, first=5, max_trials=10**6)
    runs, covered = 3000, 0
    for _ in range(runs):
        first = rng.normal(size=5).tolist()
        scores = [*first, *rng.normal(size=validation.count_all(first) - 5).tolist()]
        low, high = validation.bound_mean(scores, 5)
        assert high - low <= 2 * 0.5 + 1e-5
        covered += low <= 0 <= high
    assert covered / runs == pytest.approx(0.95, abs=4 * math.sqrt(0.95 * 0.05 / runs))


def test_the_number_of_trials_is_bounded() -> None:
    validation = Validation(precision=0.01, first=3, max_trials=40)
    assert validation.count_all([0.0, 9.0, 4.0]) == 40
    assert validation.count_all([5.0, 5.0, 5.0]) == 3
    assert Validation().count_all([1.0]) == 1
    assert all(map(math.isnan, Validation().bound_mean([1.0], 1)))
    assert all(map(math.isnan, Validation().bound_rate(0, 0)))


@given(st.lists(st.tuples(st.integers(-50, 50), st.integers(-50, 50)), min_size=3, max_size=12))
def test_the_chance_of_a_rival_is_the_p_value_of_the_paired_test(
    pairs: list[tuple[int, int]],
) -> None:
    champion, rival = ([float(value) for value in side] for side in zip(*pairs, strict=True))
    chance = compute_chance(champion, rival)
    assert chance + compute_chance(rival, champion) == pytest.approx(1, abs=2e-6)
    if np.std(np.subtract(champion, rival)) > 0:
        test = stats.ttest_rel(champion, rival, alternative="greater")
        assert chance == pytest.approx(float(test.pvalue), abs=2e-6)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=6))
def test_more_rivals_are_never_a_smaller_chance(chances: list[float]) -> None:
    together = combine_chances(chances)
    assert max(chances) - 1e-6 <= together <= min(1.0, sum(chances)) + 1e-6
    assert combine_chances([*chances, math.nan]) == together


@pytest.mark.parametrize(
    ("bad", "name"),
    [
        ({"precision": 0.0}, "precision"),
        ({"precision": 0.1, "first": 1}, "first"),
        ({"precision": 0.1, "max_trials": 5}, "first"),
        ({"confidence": 95}, "confidence"),
        ({"rivals": -1}, "rivals"),
    ],
)
def test_values_out_of_range_are_refused(bad: dict[str, float], name: str) -> None:
    with pytest.raises(InputError, match=name):
        Validation(**bad)  # type: ignore[arg-type]
