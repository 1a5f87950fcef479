"""Races, which drop designs that are worse than the leader and run the others again."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

from scipy.special import stdtrit

from evoros.allocation.protocol import Allocation, Standing, ask_for, choose_entrants
from evoros.base.checks import COUNT, WHOLE, Rule, checked, is_number
from evoros.base.errors import InputError

LEVEL = Rule("a number greater than 0 and less than 0.5", lambda v: is_number(v) and 0 < v < 0.5)
DIGITS = 6  # decimal places of a quantile, equal on all processors


@dataclass(frozen=True)
@checked
class Racing(Allocation):
    """Races new designs and the best survivors on common random numbers.

    Each round runs one trial of each remaining design. A design is then dropped if it is worse than
    the leader in a one-sided paired t-test. The race ends when ``best`` designs remain, or after
    ``max_trials``. This is the race with uncorrected t-tests by Birattari, Stützle, Paquete and
    Varrentrapp (A racing algorithm for configuring metaheuristics, GECCO 2002). Heidrich-Meisner
    and Igel (ICML 2009) also apply races to evolution strategies.
    """

    survivors: Annotated[int, WHOLE] = 5  # number of best earlier designs to include
    first: Annotated[int, replace(COUNT, limit=1000)] = 2  # number of trials before the first test
    max_trials: Annotated[int, COUNT] = 8  # maximum per design and generation
    best: Annotated[int, COUNT] = 3  # number of remaining designs that ends the race
    level: Annotated[float, LEVEL] = 0.1  # significance level of each test

    def __post_init__(self) -> None:
        if self.first > self.max_trials:
            raise InputError(
                f"allocation.first: must be at most allocation.max_trials ({self.max_trials}), not "
                f"{self.first}; lower allocation.first"
            )

    def most_trials(self, trials: int) -> int:
        return max(trials, self.max_trials)

    def next_round(self, standings: Sequence[Standing], trials: int) -> Mapping[int, int]:
        racing = choose_entrants(standings, self.survivors)
        start = max(trials, min(self.first, self.max_trials))
        for done in range(start, self.most_trials(trials) + 1):
            missing = ask_for(racing, done)
            if missing:
                return missing
            racing = self._leave(racing, done)
            if len(racing) <= self.best:
                break
        return {}

    def _leave(self, racing: Sequence[Standing], trials: int) -> list[Standing]:
        if trials < 2 or not racing:
            return list(racing)
        leader = max(racing, key=lambda standing: sum(standing.scores[:trials]))
        quantile = round(float(stdtrit(trials - 1, 1 - self.level)), DIGITS)
        return [racer for racer in racing if not _is_worse(racer, leader, trials, quantile)]


def _is_worse(standing: Standing, leader: Standing, trials: int, quantile: float) -> bool:
    """Return True if the paired t statistic of the first ``trials`` trials exceeds the quantile."""
    pairs = zip(leader.scores[:trials], standing.scores[:trials], strict=True)
    behind = [ahead - score for ahead, score in pairs]
    mean = sum(behind) / trials
    squares = sum((difference - mean) * (difference - mean) for difference in behind)
    # t = mean / sqrt(squares / (n - 1) / n); both sides are squared to avoid the root
    return mean > 0 and mean * mean * trials * (trials - 1) > quantile * quantile * squares
