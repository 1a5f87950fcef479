"""The trials of a stated case, and what they say of the rate at which worlds are completed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import sqrt

from evoros.certificate.validation import DIGITS, Bounds, bound_rate
from evoros.failure.case import SCREENED, Case
from evoros.mission.outcome import Outcome


@dataclass(eq=False)
class CaseTrials:
    """The outcomes of a case in each world, in the order of the trials."""

    case: Case
    number: int  # in the order in which cases were tried
    stage: str = SCREENED
    outcomes: dict[str, list[Outcome]] = field(default_factory=dict)

    def add(self, found: Mapping[str, Sequence[Outcome]]) -> None:
        """Add the outcomes of further trials."""
        for world, outcomes in found.items():
            self.outcomes.setdefault(world, []).extend(outcomes)

    def count(self, world: str) -> tuple[int, int]:
        """Return how many missions were completed in a world, and how many there were."""
        outcomes = self.outcomes[world]
        return sum(outcome.completed for outcome in outcomes), len(outcomes)

    @property
    def severity(self) -> tuple[float, float]:
        """How well the case is borne in its worst world; lower is worse.

        The rate of completion, drawn to one half as if there were two trials more, and the mean
        progress.
        """
        rates, progress = [], []
        for world, outcomes in self.outcomes.items():
            completed, trials = self.count(world)
            rates.append((completed + 1) / (trials + 2))
            done = [0.0 if each.progress != each.progress else each.progress for each in outcomes]
            progress.append(sum(done) / len(done))
        return min(rates), min(progress)

    @property
    def lost_any(self) -> bool:
        """Whether any mission was not completed."""
        return any(not each.completed for own in self.outcomes.values() for each in own)

    def list_stopped(self, nominal: "CaseTrials", below: float, confidence: float) -> list[str]:
        """Return the worlds in which the case stops the design.

        There, the rate of completion is less than ``below``, and less than without a failure; both
        hold with the confidence.
        """
        stopped = []
        for world in self.outcomes:
            own, other = self.count(world), nominal.count(world)
            _, high = bound_rate(*own, confidence)
            _, difference = bound_difference(own, other, confidence)
            if high < below and difference < 0:
                stopped.append(world)
        return stopped


def bound_difference(first: tuple[int, int], second: tuple[int, int], confidence: float) -> Bounds:
    """Return the interval of the first rate minus the second, of (successes, trials) each.

    Source: Newcombe, Interval estimation for the difference between independent proportions,
    Statistics in Medicine 17, 1998, method 10. With common random numbers it is conservative.
    """
    rates = [successes / trials for successes, trials in (first, second)]
    (low_1, high_1), (low_2, high_2) = (bound_rate(*each, confidence) for each in (first, second))
    difference = rates[0] - rates[1]
    below, above = rates[0] - low_1, high_2 - rates[1]
    low = difference - sqrt(below * below + above * above)
    below, above = high_1 - rates[0], rates[1] - low_2
    high = difference + sqrt(below * below + above * above)
    return round(low, DIGITS), round(high, DIGITS)


def share_level(confidence: float, tests: int) -> float:
    """Return the confidence of each of several tests that hold together with ``confidence``."""
    return 1 - (1 - confidence) / tests  # Bonferroni
