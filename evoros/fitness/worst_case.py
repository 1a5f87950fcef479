"""Worst-case fitness: the mean of a design's lowest scores."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from evoros.base.arrays import Array
from evoros.base.checks import FRACTION, checked, instance_of
from evoros.base.combining import mean_lowest
from evoros.base.rng import generator
from evoros.certificate.rates import DIGITS, LOWER_SHARE, Bounds
from evoros.fitness.naming import bound_fitness, name_fitness
from evoros.fitness.protocol import CombiningFitness, Fitness
from evoros.mission.mission import Outcome

A_FITNESS = instance_of(Fitness, "a fitness function (a subclass of evoros.parts.Fitness)")
RESAMPLES = 10_000


@dataclass(frozen=True)
@checked
class WorstCase(CombiningFitness):
    """The mean over the lowest ``share`` of a design's trials, each scored by ``of``.

    With random failures, this estimates the conditional value at risk; with a systematic failure
    model and one trial per case, it is the mean over the worst cases. A few trials seldom include
    the worst draws, so the estimate is too high (for normal scores and a share of 1/4, by 0.24
    standard deviations with 4 trials, and by 0.14 with 8). ``combine`` therefore compares designs
    at equal numbers of trials.
    """

    of: Annotated[Fitness, A_FITNESS]
    share: Annotated[float, FRACTION] = 0.25  # share of the trials; at least one trial

    @property
    def title(self) -> str:
        return f"{name_fitness(self.of).title}, mean of the lowest {100 * self.share:.3g} %"

    @property
    def unit(self) -> str:
        return name_fitness(self.of).unit

    def bounds(self, worlds: int) -> tuple[float, ...]:
        return bound_fitness(self.of, worlds)

    def score(self, outcomes: Sequence[Outcome]) -> float:
        return self.of.score(outcomes)

    def worst(self, outcomes: Sequence[Outcome]) -> float:
        return self.of.worst(outcomes)

    def combine(self, scores: Sequence[float], trials: int | None = None) -> float:
        """Return the mean of the lowest scores, as expected for this number of ``trials``."""
        return mean_lowest(scores, self.share, trials)

    def bound_combined(self, scores: Sequence[float], limits: Bounds, confidence: float) -> Bounds:
        """Return an interval of the conditional value at risk; see ``bound_lowest``."""
        return bound_lowest(scores, self.share, limits, confidence)


def bound_lowest(
    scores: Sequence[float], share: float, limits: Bounds, confidence: float
) -> Bounds:
    """Return an interval of the mean of the lowest share of a distribution within ``limits``.

    As in ``certificate.rates``, the minimum score is added for the lower end, the maximum score for
    the upper end, and all scores have random weights, to allow for failures that did not occur. For
    a share of 1 and scores at the limits, the interval is that by Clopper and Pearson. Otherwise,
    the coverage is conjectured, and ``benchmarks/coverage`` tests it.
    """
    ordered, error = np.sort(np.asarray(scores, dtype=np.float64)), 1 - confidence
    count = len(ordered)
    uniform = np.sort(generator("interval", f"{count}").random((RESAMPLES, count)), axis=1)
    weights = np.diff(uniform, axis=1, prepend=0.0, append=1.0)
    least, most = limits
    low = _weigh_lowest(np.array([least, *ordered]), weights, share)
    high = _weigh_lowest(np.array([*ordered, most]), weights, share)
    ends = np.quantile(low, LOWER_SHARE * error), np.quantile(high, 1 - (1 - LOWER_SHARE) * error)
    return round(float(ends[0]), DIGITS), round(float(ends[1]), DIGITS)


def _weigh_lowest(ordered: Array, weights: Array, share: float) -> Array:
    """Return the mean of the lowest share of sorted values for each row of weights."""
    before = np.cumsum(weights, axis=1) - weights
    return np.asarray((np.clip(share - before, 0.0, weights) * ordered).sum(axis=1) / share)
