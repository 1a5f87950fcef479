"""The fitness function of the 2018 paper on Evo-ROS, Eq. 1."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import NOT_NEGATIVE, checked
from evoros.fitness.protocol import AdditiveFitness
from evoros.mission.mission import Outcome

NOTHING_DONE = 1.0  # value of Eq. 1 without any progress
COMPLETED_AT_ONCE = 8.0  # value of Eq. 1 for instant completion: (1 + 1)^2 + (1 + 1)^2


@dataclass(frozen=True)
@checked
class EquationOne(AdditiveFitness):
    """Eq. 1 of the 2018 paper: the sum over worlds of (1 + progress)^2 + C (1 + time left)^2.

    C is 1 for completed missions, otherwise 0; the time left is relative to the time limit. Each
    world contributes between 1 (no progress) and 8 (completed in no time).
    """

    sensor_penalty: Annotated[float, NOT_NEGATIVE] = 0.0  # per sensor; 0.3 in the original runs
    price_weight: Annotated[float, NOT_NEGATIVE] = 0.0  # per unit of the sensors' total price

    @property
    def title(self) -> str:
        penalizes = self.sensor_penalty > 0 or self.price_weight > 0
        return f"fitness (Eq. 1{' less penalties' * penalizes})"

    def bounds(self, worlds: int) -> tuple[float, ...]:
        """Return the minimum and maximum for ``worlds``; empty if penalties are subtracted."""
        if self.sensor_penalty > 0 or self.price_weight > 0:
            return ()
        return worlds * NOTHING_DONE, worlds * COMPLETED_AT_ONCE

    def score(self, outcomes: Sequence[Outcome]) -> float:
        return sum(map(equation_one, outcomes)) - self._penalty(outcomes)

    def score_missions(self, outcomes: Sequence[Outcome]) -> list[float]:
        """Return Eq. 1 of each mission times the number of worlds, minus the penalties."""
        worlds, penalty = len(outcomes), self._penalty(outcomes)
        return [worlds * equation_one(outcome) - penalty for outcome in outcomes]

    def worst(self, outcomes: Sequence[Outcome]) -> float:
        return len(outcomes) * NOTHING_DONE - self._penalty(outcomes)

    def _penalty(self, outcomes: Sequence[Outcome]) -> float:
        if not outcomes:
            return 0.0
        design = outcomes[0]  # sensors are the same in all worlds
        return self.sensor_penalty * design.sensors + self.price_weight * design.price


def equation_one(outcome: Outcome) -> float:
    """Return Eq. 1 for one mission, a value from 1 to 8."""
    progress = (1.0 + outcome.progress) * (1.0 + outcome.progress)
    if not outcome.completed:
        return progress
    speed = 2.0 - outcome.time_s / outcome.time_limit_s
    return progress + speed * speed
