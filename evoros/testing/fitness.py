"""The checks of fitness functions."""

import math
from collections.abc import Iterator

from evoros.fitness.naming import UNBOUNDED, bound_fitness
from evoros.fitness.protocol import CombiningFitness, Fitness
from evoros.testing.part import PartSuite
from evoros.testing.subjects import example_outcome, list_lost_trials, list_trials


class FitnessSuite(PartSuite):
    """The checks of a fitness."""

    part: Fitness
    protocol = Fitness

    def use(self, part: Fitness, seed: int) -> Iterator[float]:
        """Score trials that ended in every way, and combine the scores."""
        scores = [part.score(self.lend(trial)) for trial in list_trials()]
        yield from scores
        yield from (part.worst(self.lend(trial)) for trial in list_lost_trials())
        if isinstance(part, CombiningFitness):
            yield part.combine(self.lend(scores[seed % 2 :]))

    def test_scores_are_finite(self) -> None:
        """Neither a clearance that is NaN nor a mission that was not run makes the score NaN."""
        for score in self.use(self.part, 0):
            assert isinstance(score, float | int), f"a score must be a number, not {score!r}"
            assert math.isfinite(score), f"a score is {score}"

    def test_scores_are_within_the_bounds(self) -> None:
        """A fitness that states ``bounds`` gives no score beyond them."""
        for trial in list_trials():
            low, high = bound_fitness(self.part, len(trial)) or UNBOUNDED
            score = self.part.score(trial)
            assert low <= score <= high, f"a score is {score}, beyond {low} to {high}"

    def test_a_trial_that_was_not_run_is_worst(self) -> None:
        """Its score is at most that of a trial without any progress."""
        nothing = self.part.score([example_outcome(0.0)] * 2)
        for trial in list_lost_trials():
            worst = self.part.worst(trial)
            assert worst <= nothing, f"worst is {worst}, and no progress scores {nothing}"
