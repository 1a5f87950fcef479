"""Conformance tests for fitness functions and measures."""

import math
from collections.abc import Iterator
from dataclasses import replace

from evoros.fitness.equation_one import EquationOne
from evoros.fitness.naming import UNBOUNDED, bound_fitness
from evoros.fitness.protocol import AdditiveFitness, CombiningFitness, Fitness
from evoros.fitness.scoring import Scoring
from evoros.measure.protocol import BOUNDS, DIRECTION, Evaluated, Measure
from evoros.testing.part import PartSuite
from evoros.testing.subjects import example_design, example_robot, list_lost_trials, list_trials


class FitnessSuite(PartSuite):
    """Conformance tests for a fitness function."""

    part: Fitness
    protocol = Fitness

    def use(self, part: Fitness, seed: int) -> Iterator[float]:
        """Score trials that end in all possible ways, and combine the scores."""
        scores = [part.score(self.lend(trial)) for trial in list_trials()]
        yield from scores
        yield from (part.worst(self.lend(trial)) for trial in list_lost_trials())
        if isinstance(part, CombiningFitness):
            yield part.combine(self.lend(scores[seed % 2 :]))
            yield part.combine(self.lend(scores), 1)

    def test_scores_are_finite(self) -> None:
        """Scores are finite, even if a clearance is NaN or a mission did not run."""
        for score in self.use(self.part, 0):
            assert isinstance(score, float | int), f"a score must be a number, not {score!r}"
            assert math.isfinite(score), f"a score must be finite, not {score}"

    def test_scores_are_within_the_bounds(self) -> None:
        """Scores are within ``bounds``, if the fitness function states them."""
        for trial in list_trials():
            low, high = bound_fitness(self.part, len(trial)) or UNBOUNDED
            score = self.part.score(trial)
            assert low <= score <= high, f"{score} must be within the bounds, {low} to {high}"

    def test_a_trial_that_was_not_run_is_worst(self) -> None:
        """The score of a lost trial is at most the score of any other trial."""
        lowest = min(map(self.part.score, list_trials()))
        for trial in list_lost_trials():
            worst = self.part.worst(trial)
            assert worst <= lowest, f"worst() must be at most {lowest}, not {worst}"

    def test_scores_of_missions_have_the_score_of_the_trial_as_their_mean(self) -> None:
        """The trial score of an additive fitness function is the mean over its missions."""
        part = self.part
        if not isinstance(part, AdditiveFitness):
            return
        for trial in list_trials():
            scores, whole, count = part.score_missions(trial), part.score(trial), len(trial)
            assert len(scores) == count, f"{count} missions must have {count} scores, not {scores}"
            mean = math.fsum(scores) / count
            same = math.isclose(mean, whole, rel_tol=1e-9)
            assert same, f"the mean {mean} must be the trial's score, {whole}"


def example_result(share: float, trials: int) -> Evaluated:
    """Return the result of a design with equal genes after a given number of trials."""
    chosen = [[(outcome,) for outcome in trial] for trial in list_trials()[:trials]]
    robots, score = {"": example_robot(share)}, Scoring(EquationOne()).score_trial
    return Evaluated(example_design(share), robots, chosen, 5.0, score)


class MeasureSuite(PartSuite):
    """Conformance tests for a measure."""

    part: Measure
    protocol = Measure

    def use(self, part: Measure, seed: int) -> Iterator[float]:
        """Measure several designs."""
        for share in (0.2, 0.6, 0.9):
            yield part.compute(self.lend(example_result(share, 1 + seed % 3)))

    def test_it_is_finite(self) -> None:
        """The measure is finite, because otherwise it could not rank designs."""
        for value in self.use(self.part, 2):
            assert isinstance(value, float | int), f"a measure must be a number, not {value!r}"
            assert math.isfinite(value), f"a measure must be finite, not {value}"

    def test_it_can_be_drawn_and_compared(self) -> None:
        """The measure has a title, a unit, ordered bounds and a direction."""
        part = self.part
        assert isinstance(part.title, str), f"title must be a string, not {part.title!r}"
        assert part.title, "title must not be empty"
        assert isinstance(part.unit, str), f"unit must be a string, not {part.unit!r}"
        assert BOUNDS.holds(part.bounds), f"bounds must be {BOUNDS.text}, not {part.bounds}"
        assert DIRECTION.holds(part.direction), f"direction must be {DIRECTION.text}"

    def test_a_measure_of_the_design_uses_no_outcomes(self) -> None:
        """A measure of the design alone has the same value before the run, without trials."""
        if self.part.of_design:
            whole = example_result(0.6, 3)
            before = self.part.compute(replace(whole, trials=(), fitness=math.nan))
            assert before == self.part.compute(whole), (
                "of_design must be false if the measure depends on outcomes"
            )
