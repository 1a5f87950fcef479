"""The checks of measures."""

import math
from collections.abc import Iterator
from dataclasses import replace

from evoros.fitness.equation_one import EquationOne
from evoros.fitness.scoring import Scoring
from evoros.measure.protocol import BOUNDS, DIRECTION, Evaluated, Measure
from evoros.testing.part import PartSuite
from evoros.testing.subjects import example_design, example_robot, list_trials


def example_result(share: float, trials: int) -> Evaluated:
    """Return a design, whose genes all have the same value, with so many trials."""
    chosen = [[(outcome,) for outcome in trial] for trial in list_trials()[:trials]]
    robots, score = {"": example_robot(share)}, Scoring(EquationOne()).score_trial
    return Evaluated(example_design(share), robots, chosen, 5.0, score)


class MeasureSuite(PartSuite):
    """The checks of a measure."""

    part: Measure
    protocol = Measure

    def use(self, part: Measure, seed: int) -> Iterator[float]:
        """Measure some designs."""
        for share in (0.2, 0.6, 0.9):
            yield part.compute(self.lend(example_result(share, 1 + seed % 3)))

    def test_it_is_finite(self) -> None:
        """NaN would tell no designs apart."""
        for value in self.use(self.part, 2):
            assert isinstance(value, float | int), f"a measure must be a number, not {value!r}"
            assert math.isfinite(value), f"the measure is {value}"

    def test_it_can_be_drawn_and_compared(self) -> None:
        """It has a title, a unit, bounds in order and a direction."""
        part = self.part
        assert isinstance(part.title, str), f"title must be a text, not {part.title!r}"
        assert part.title, "title must not be empty"
        assert isinstance(part.unit, str), f"unit must be a text, not {part.unit!r}"
        assert BOUNDS.holds(part.bounds), f"bounds must be {BOUNDS.text}, not {part.bounds}"
        assert DIRECTION.holds(part.direction), f"direction must be {DIRECTION.text}"

    def test_a_measure_of_the_design_uses_no_outcomes(self) -> None:
        """It has the same value before a run, when there are no trials."""
        if self.part.of_design:
            whole = example_result(0.6, 3)
            bare = replace(whole, trials=(), fitness=math.nan)
            assert self.part.compute(bare) == self.part.compute(whole), (
                "of_design must be false for a measure that uses outcomes or the fitness"
            )
