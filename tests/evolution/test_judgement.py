"""How sure the fitness of a champion is, by designs of known fitness."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from evoros.base.combining import mean
from evoros.certificate.validation import Validation
from evoros.evolution.loop import Judgement
from evoros.evolution.trials import FreshTrials

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
