"""The number of a champion's trials, and those added until an interval is narrow enough."""

import math
import re
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from evoros.base.errors import InputError
from evoros.certificate.final_choice import FinalChoice
from evoros.certificate.rates import bound_mean, share_level
from evoros.certificate.validation import (
    Validation,
    check_precision,
    estimate_trials,
    find_least_width,
    foresee_trials,
    list_looks,
)


@given(
    st.integers(0, 300),
    st.integers(1, 300),
    st.integers(1, 3),
    st.tuples(st.floats(0, 24), st.floats(0, 24)),
    st.floats(0.01, 10),
)
def test_looks_ascend_to_the_maximum_and_leave_out_those_that_cannot_succeed(
    trials: int, most: int, missions: int, room: tuple[float, float], precision: float
) -> None:
    validation = Validation(precision=precision, max_trials=most)
    looks = list_looks(validation, trials, missions, room)
    assert looks == sorted(set(looks))
    assert looks[0] >= trials
    assert looks[-1] == max(trials, most)
    for earlier, later in pairwise(looks):  # of each look, two thirds, rounded down
        assert 1.5 * earlier <= later < 1.5 * (earlier + 1)
    confidence = share_level(validation.confidence, len(looks))
    assert len(looks) * (1 - confidence) == pytest.approx(1 - validation.confidence)
    for count in looks[:-1]:
        assert find_least_width(room, count * missions, confidence) <= 2 * precision


@pytest.mark.parametrize("rate", [0.8, 0.98])
def test_stopping_at_a_narrow_interval_costs_no_confidence(rate: float) -> None:
    validation, rng, count = Validation(precision=0.5, max_trials=60), np.random.default_rng(4), 60
    looks = list_looks(validation, 5, 3, (6.5, 0.0))
    confidence = share_level(validation.confidence, len(looks))
    covered = 0
    for _ in range(count):
        scores = np.where(rng.random(180) < rate, 7.5, 1.0 + rng.integers(0, 3, 180))
        for trials in looks:
            met = scores[: 3 * trials].tolist()
            low, high = bound_mean(met, 1.0, 7.5, confidence)
            if (high - low) / 2 <= 0.5:
                break
        covered += low <= rate * 7.5 + (1 - rate) * 2.0 <= high
    assert covered >= stats.binom.ppf(0.001, count, 0.95)


@settings(max_examples=15)
@given(st.lists(st.integers(0, 20).map(float), min_size=5, max_size=10), st.floats(0.2, 1))
def test_the_estimated_trials_reach_the_precision_if_further_scores_are_alike(
    scores: list[float], precision: float
) -> None:
    wanted = estimate_trials(scores, len(scores), (0.0, 20.0), 0.95, precision)
    assert wanted is not None
    low, high = bound_mean(scores, 0, 20, 0.95, -(-wanted // len(scores)))
    assert high - low <= 2 * precision + 1e-6
    step = 10 ** max(0, len(str(wanted)) - 2)
    assert wanted % step == 0  # two significant digits
    fewer = (wanted - step) // len(scores)
    if fewer > 1:  # one repeat is what there is, and does not suffice
        low, high = bound_mean(scores, 0, 20, 0.95, fewer)
        assert high - low > 2 * precision - 1e-6


def test_no_number_of_trials_is_stated_for_a_precision_far_beyond_them() -> None:
    assert estimate_trials([5.0, 9.0], 2, (0.0, 20.0), 0.95, 1e-6) is None


def test_a_precision_that_no_trials_reach_is_refused_with_what_to_set() -> None:
    check_precision(Validation(precision=0.3), 3, (3.0, 24.0))
    check_precision(Validation(precision=0.001), 3, ())
    check_precision(Validation(precision=0.001), 3, (3.0, math.inf))
    check_precision(Validation(), 3, (3.0, 24.0))
    with pytest.raises(InputError, match=r"validation\.precision") as refusal:
        check_precision(Validation(precision=0.001), 3, (3.0, 24.0))
    (reached,) = re.findall(r"at least ([\d.]+)", str(refusal.value))
    check_precision(Validation(precision=float(reached)), 3, (3.0, 24.0))
    most = int(str(refusal.value).rpartition("=")[2].rstrip(")"))
    check_precision(Validation(precision=0.001, max_trials=most), 3, (3.0, 24.0))


def test_what_is_foreseen_is_the_first_look_of_a_middling_fitness() -> None:
    validation, bounds = Validation(precision=0.1, max_trials=10_000), (3.0, 24.0)
    (count,) = re.findall(r"at least (\d+) trials", foresee_trials(validation, 3, bounds))
    assert int(count) == list_looks(validation, 1, 3, (10.5, 10.5))[0]
    assert find_least_width((10.5, 10.5), 3 * int(count), 0.95) <= 0.2
    assert foresee_trials(Validation(), 3, bounds) == ""
    assert foresee_trials(validation, 3, (3.0, math.inf)) == ""


@pytest.mark.parametrize(
    ("bad", "name"),
    [
        ({"precision": 0.0}, "precision"),
        ({"trials": 0}, "trials"),
        ({"trials": 6, "max_trials": 5}, "set validation.max_trials=6"),
        ({"confidence": 95}, "confidence"),
        ({"rivals": -1}, "rivals"),
    ],
)
def test_values_out_of_range_are_refused(bad: dict[str, float], name: str) -> None:
    with pytest.raises(InputError, match=name):
        Validation(**bad)  # type: ignore[arg-type]


def test_a_final_choice_names_the_value_that_it_cannot_use() -> None:
    with pytest.raises(InputError, match="method"):
        FinalChoice(method="halving")  # type: ignore[arg-type]
