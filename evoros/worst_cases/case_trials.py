"""The trials of a stated case, and the rates at which they complete worlds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from math import isnan, sqrt

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

    def add(self, further: Mapping[str, Sequence[Outcome]]) -> None:
        """Add the outcomes of further trials."""
        for world, outcomes in further.items():
            self.outcomes.setdefault(world, []).extend(outcomes)

    def count(self, world: str) -> tuple[int, int]:
        """Return how many missions were completed in a world, and how many there were."""
        outcomes = self.outcomes[world]
        return sum(outcome.completed for outcome in outcomes), len(outcomes)

    @property
    def severity(self) -> tuple[float, float]:
        """The rate of completion and the mean progress in the worst world; lower is worse.

        The rate is drawn to one half as if there were two trials more.
        """
        rates, progress = [], []
        for world, outcomes in self.outcomes.items():
            completed, trials = self.count(world)
            rates.append((completed + 1) / (trials + 2))
            done = [0.0 if isnan(outcome.progress) else outcome.progress for outcome in outcomes]
            progress.append(sum(done) / len(done))
        return min(rates), min(progress)

    @property
    def lost_any(self) -> bool:
        """Whether any mission was not completed."""
        return not all(outcome.completed for outcome in chain(*self.outcomes.values()))

    def list_stopped(self, nominal: "CaseTrials", below: float, confidence: float) -> list[str]:
        """Return the worlds in which the case stops the design.

        There, the rate of completion is less than ``below``, and less than without a failure; both
        hold with the confidence.
        """
        stopped = []
        for world in self.outcomes:
            failed, whole = self.count(world), nominal.count(world)
            _, high = bound_rate(*failed, confidence)
            _, difference = bound_difference(failed, whole, confidence)
            if high < below and difference < 0:
                stopped.append(world)
        return stopped


def bound_difference(first: tuple[int, int], second: tuple[int, int], confidence: float) -> Bounds:
    """Return the interval of the first rate minus the second, of (successes, trials) each.

    Source: Newcombe, Interval estimation for the difference between independent proportions,
    Statistics in Medicine 17, 1998, method 10. With common random numbers it is conservative.
    """
    rates = [successes / trials for successes, trials in (first, second)]
    (low_1, high_1), (low_2, high_2) = (bound_rate(*rate, confidence) for rate in (first, second))
    difference = rates[0] - rates[1]
    below, above = rates[0] - low_1, high_2 - rates[1]
    low = difference - sqrt(below * below + above * above)
    below, above = high_1 - rates[0], rates[1] - low_2
    high = difference + sqrt(below * below + above * above)
    return round(low, DIGITS), round(high, DIGITS)


def share_level(confidence: float, tests: int) -> float:
    """Return the confidence of each of several tests that hold together with ``confidence``."""
    return 1 - (1 - confidence) / tests  # Bonferroni
