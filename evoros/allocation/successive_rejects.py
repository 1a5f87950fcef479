"""Successive rejects: a fixed number of trials, in phases that each reject one design."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from typing import Annotated

from evoros.allocation.protocol import Allocation, Standing, ask_for, choose_entrants, rank
from evoros.base.checks import COUNT, WHOLE, checked


@dataclass(frozen=True)
@checked
class SuccessiveRejects(Allocation):
    """Runs new designs and the best survivors in phases; each phase rejects the worst design.

    In phase k of K - 1, each remaining design reaches ceil((n - K) / (L (K + 1 - k))) trials, where
    n is the budget and L = 1/2 + 1/2 + 1/3 + ... + 1/K. Source: Audibert, Bubeck and Munos, Best
    arm identification in multi-armed bandits, COLT 2010.
    """

    survivors: Annotated[int, WHOLE] = 5  # number of best earlier designs to include
    budget: Annotated[int, COUNT] = 3  # average trials per included design
    max_trials: Annotated[int, COUNT] = 100  # maximum per design and generation

    def most_trials(self, trials: int) -> int:
        return max(trials, self.max_trials)

    def next_round(self, standings: Sequence[Standing], trials: int) -> Mapping[int, int]:
        remaining = choose_entrants(standings, self.survivors)
        for lengths in _phases(len(remaining), self.budget):
            done = min(max(lengths, trials), self.most_trials(trials))
            missing = ask_for(remaining, done)
            if missing:
                return missing
            remaining = rank(remaining, done)[:-1]
        return {}


def _phases(designs: int, budget: int) -> Iterator[int]:
    """Yield the number of trials that each remaining design has at the end of each phase."""
    if designs <= 1:
        yield from [budget] * designs
        return
    scale = Fraction(1, 2) + sum(Fraction(1, i) for i in range(2, designs + 1))
    for phase in range(1, designs):
        yield ceil((budget * designs - designs) / (scale * (designs + 1 - phase)))
