"""Survivors are scored again in each generation; fitness is the mean over a design's life."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.allocation.protocol import Standing, choose_entrants
from evoros.base.checks import COUNT, checked


@dataclass(frozen=True)
@checked
class Lifelong:
    """New designs get their trials, and the best survivors of the last generation some more.

    A design that owes its fitness to luck loses it while it survives, so that evolution does not
    keep the lucky ones. Source: Beyer, Evolutionary algorithms in noisy environments, Computer
    Methods in Applied Mechanics and Engineering 186, 2000, on elitism under noise.
    """

    survivors: Annotated[int, COUNT] = 10  # the best of each generation that get further trials
    again: Annotated[int, COUNT] = 1  # further trials of each of them

    def most_trials(self, trials: int) -> int:
        """Return the trials of a new design, or of a survivor if these are more."""
        return max(trials, self.again)

    def next_round(self, standings: Sequence[Standing], trials: int) -> Mapping[int, int]:
        """Return one round, of the new designs and the best survivors."""
        if any(standing.scores for standing in standings):
            return {}
        entrants = choose_entrants(standings, self.survivors)
        return {entrant.id: trials if entrant.new else self.again for entrant in entrants}
