"""An allocation that scores survivors again in each generation and averages over their lives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.allocation.protocol import Allocation, Standing, choose_entrants
from evoros.base.checks import COUNT, checked


@dataclass(frozen=True)
@checked
class Lifelong(Allocation):
    """Run new designs, and run the best survivors of the last generation again.

    A design that owes its fitness to luck loses it while it survives, so evolution does not keep
    lucky designs. Source: Beyer, Evolutionary algorithms in noisy environments, Computer Methods
    in Applied Mechanics and Engineering 186, 2000, on elitism under noise.
    """

    # number of best designs of a generation that get further trials
    survivors: Annotated[int, COUNT] = 10
    again: Annotated[int, COUNT] = 1  # further trials per survivor

    def most_trials(self, trials: int) -> int:
        """Return the trials of a new design or of a survivor, whichever number is larger."""
        return max(trials, self.again)

    def next_round(self, standings: Sequence[Standing], trials: int) -> Mapping[int, int]:
        """Return a single round, for the new designs and the best survivors."""
        if any(standing.scores for standing in standings):
            return {}
        entrants = choose_entrants(standings, self.survivors)
        return {entrant.id: trials if entrant.new else self.again for entrant in entrants}
