"""An allocation that evaluates survivors again in each generation and averages all trials."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.allocation.protocol import Allocation, Standing, choose_entrants
from evoros.base.checks import COUNT, checked


@dataclass(frozen=True)
@checked
class Lifelong(Allocation):
    """Runs new designs, and repeats the best survivors of the previous generation.

    Further trials correct the fitness of designs that were lucky in their first trials, so lucky
    designs do not survive for long. Source: Beyer, Evolutionary algorithms in noisy environments,
    Computer Methods in Applied Mechanics and Engineering 186, 2000, on elitism under noise.
    """

    survivors: Annotated[int, COUNT] = 10  # number of best earlier designs to repeat
    again: Annotated[int, COUNT] = 1  # further trials per survivor

    def most_trials(self, trials: int) -> int:
        return max(trials, self.again)

    def next_round(self, standings: Sequence[Standing], trials: int) -> Mapping[int, int]:
        if any(standing.scores for standing in standings):
            return {}
        entrants = choose_entrants(standings, self.survivors)
        return {entrant.id: trials if entrant.new else self.again for entrant in entrants}
