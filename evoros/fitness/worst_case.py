"""Fitness in the worst cases: the mean of a design's lowest trials."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import Rule, checked, instance_of, is_number
from evoros.base.combining import mean
from evoros.fitness.naming import bound_fitness, name_fitness
from evoros.fitness.protocol import Fitness
from evoros.mission.outcome import Outcome

A_FITNESS = instance_of(Fitness, "a fitness (score and worst)")
SHARE = Rule("a number greater than 0 and at most 1", lambda v: is_number(v) and 0 < v <= 1)


@dataclass(frozen=True)
@checked
class WorstCase:
    """Scores trials as ``of`` does; a design has the mean of the lowest ``share`` of its trials.

    With failures that are drawn, this estimates the conditional value at risk (Rockafellar and
    Uryasev, Optimization of conditional value-at-risk, Journal of Risk 2, 2000). With a systematic
    failure and a trial for each case, it is the mean over the worst cases. A share rather than
    a count of trials puts designs with many trials at no disadvantage.
    """

    of: Annotated[Fitness, A_FITNESS]
    share: Annotated[float, SHARE] = 0.25  # of the trials, rounded up: at least one

    @property
    def title(self) -> str:
        """Its name in figures: the title of ``of``, and the share."""
        return f"{name_fitness(self.of).title}, mean of the lowest {100 * self.share:.3g} %"

    @property
    def unit(self) -> str:
        """The unit of ``of``."""
        return name_fitness(self.of).unit

    def bounds(self, worlds: int) -> tuple[float, ...]:
        """Return the bounds of ``of``."""
        return bound_fitness(self.of, worlds)

    def score(self, outcomes: Sequence[Outcome]) -> float:
        """Return the score of a trial."""
        return self.of.score(outcomes)

    def worst(self, outcomes: Sequence[Outcome]) -> float:
        """Return the score of a trial in which a mission could not be run."""
        return self.of.worst(outcomes)

    def combine(self, scores: Sequence[float]) -> float:
        """Return the mean of the lowest scores."""
        count = math.ceil(round(self.share * len(scores), 9))
        return mean(sorted(scores)[: max(1, count)])
