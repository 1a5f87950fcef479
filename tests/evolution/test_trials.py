"""Scores of trials, the best candidate, and how sure the fitness of a champion is."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fixture_types import Log
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from evoros.base.combining import mean
from evoros.certificate.validation import Validation
from evoros.evolution.loop import Judgement
from evoros.evolution.scores import find_best
from evoros.evolution.trials import FreshTrials, Measuring, list_values, read_score
from evoros.measure.cost import Cost
from evoros.measure.coverage import Coverage
from evoros.measure.sensor_number import SensorNumber
from evoros.optimizer.protocol import Candidate, Individual, Score
from evoros.testing.subjects import example_experiment


def test_a_score_is_read_again_from_its_values() -> None:
    experiment = replace(example_experiment(), objectives={"a": Cost(), "b": Coverage()})
    score = Score(3.5, (-7.25, 0.1), ())
    columns = dict(zip(("objectives.a", "objectives.b"), (7.25, 0.1), strict=True))
    assert list_values(experiment, score) == list(columns.values())
    assert read_score(experiment, {"fitness": 3.5, **columns}) == score


def test_a_descriptor_that_is_equal_for_several_designs_is_reported(caplog: Log) -> None:
    scores = {i: Score(float(i), (), (2.0,)) for i in range(3)}
    measuring = Measuring(replace(example_experiment(), descriptors={"one": SensorNumber()}))
    measuring.check_variety({0: scores[0]})
    measuring.check_variety({**scores, 3: Score(0.0, (), (4.0,))})
    assert not caplog.text
    measuring.check_variety({0: scores[0], 1: scores[1]})
    assert "descriptors.one: should differ" in caplog.text


FITNESS = st.floats(-24, 24)


@given(st.lists(st.tuples(FITNESS, st.booleans()), min_size=1, max_size=8))
def test_a_confirmed_candidate_wins_over_a_fitter_one_that_is_not(
    rows: list[tuple[float, bool]],
) -> None:
    candidates = [
        Candidate(Individual(i, np.zeros(1), (), "initial"), "survivor", fitness, 1)
        for i, (fitness, _) in enumerate(rows)
    ]
    confirmed = {i for i, (_, is_confirmed) in enumerate(rows) if is_confirmed}
    best = find_best(candidates, confirmed)
    rivals = [row for row in candidates if not confirmed or row.individual.id in confirmed]
    assert best in rivals
    assert best.fitness == max(row.fitness for row in rivals)


CHAMPION, SCORE, LOWEST = 0, 7.5, 1.0


def judge(rates: list[float], rng: np.random.Generator, trials: int) -> Judgement:
    """Judge the first of designs that score ``SCORE`` at these rates, and otherwise ``LOWEST``.

    Trials have three missions. All designs meet the same draws.
    """
    luck = rng.random(3 * trials)
    fresh = {}
    for design, rate in enumerate(rates):
        scores = np.where(luck < rate, SCORE, LOWEST)
        whole, met = scores.reshape(-1, 3).mean(1).tolist(), [SimpleNamespace(completed=True)]
        outcomes: Any = {"world": met if (scores == SCORE).any() else []}
        fresh[design] = FreshTrials(whole, scores.tolist(), LOWEST, outcomes)
    experiment = SimpleNamespace(
        validation=Validation(),
        scoring=SimpleNamespace(combine=mean),
        fitness_bounds=(LOWEST, 8.0),
        scored_missions=3,
    )
    validated: Any = SimpleNamespace(trials=SimpleNamespace(experiment=experiment), fresh=fresh)
    champion: Any = SimpleNamespace(id=CHAMPION)
    return Judgement(validated, champion)


@pytest.mark.parametrize("rates", [[0.9] * 5, [0.7, 0.95, 0.6]])
def test_rivals_are_no_better_than_stated_and_not_shown_better_if_they_are_not(
    rates: list[float],
) -> None:
    rng, count = np.random.default_rng(6), 40
    bounded, shown = 0, 0
    fitness = [rate * SCORE + (1 - rate) * LOWEST for rate in rates]
    better = [value > fitness[CHAMPION] for value in fitness]
    for _ in range(count):
        judged = judge(rates, rng, 5)
        low, high = judged.bound(CHAMPION, judged.confidence)
        rivals = judged.list_rivals(())
        advantage = max(rival.high for rival in rivals) - low
        bounded += advantage >= max(fitness[1:]) - fitness[CHAMPION]
        shown += any(rival.low > high and not better[rival.design] for rival in rivals)
    assert bounded >= stats.binom.ppf(0.001, count, 0.95)
    assert shown <= stats.binom.ppf(0.999, count, 0.05)


def test_a_rival_that_is_much_better_is_shown_to_be_by_enough_trials() -> None:
    judged = judge([0.5, 0.95], np.random.default_rng(7), 40)
    (rival,) = judged.list_rivals({1})
    assert rival.led
    assert rival.low > judged.bound(CHAMPION, judged.confidence)[1]


def test_a_design_that_completes_nothing_may_still_score_the_maximum() -> None:
    judged = judge([0.0], np.random.default_rng(8), 5)
    low, high = judged.bound(CHAMPION, judged.confidence)
    # Clopper and Pearson's upper end at a fifth of 5 %, for 15 failures
    assert (low, high) == pytest.approx((LOWEST, LOWEST + 7.0 * (1 - 0.01 ** (1 / 15))), abs=2e-6)


def test_without_trials_there_is_no_interval() -> None:
    judged = judge([0.5], np.random.default_rng(9), 5)
    judged.validated.fresh[CHAMPION] = FreshTrials()
    assert all(map(math.isnan, judged.bound(CHAMPION, 0.95)))
    assert judged.list_rivals(()) == []
