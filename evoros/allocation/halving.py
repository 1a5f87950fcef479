"""Sequential halving: a fixed number of trials, in rounds that halve the number of designs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.allocation.protocol import Allocation, Standing, ask_for, choose_entrants, rank
from evoros.base.checks import COUNT, WHOLE, checked


@dataclass(frozen=True)
@checked
class SequentialHalving(Allocation):
    """Runs new designs and the best survivors in rounds, each of which keeps the better half.

    Each round has an equal share of the budget, so designs in later rounds get more trials each.
    Each design has at least the experiment's ``trials`` per round, even if this exceeds the budget.
    Sources: Karnin, Koren and Somekh, Almost optimal exploration in multi-armed bandits, ICML 2013;
    Jamieson and Talwalkar, Non-stochastic best arm identification, AISTATS 2016.
    """

    survivors: Annotated[int, WHOLE] = 5  # number of best earlier designs to include
    budget: Annotated[int, COUNT] = 3  # average trials per included design
    max_trials: Annotated[int, COUNT] = 16  # maximum per design and generation

    def most_trials(self, trials: int) -> int:
        return max(trials, self.max_trials)

    def next_round(self, standings: Sequence[Standing], trials: int) -> Mapping[int, int]:
        remaining = choose_entrants(standings, self.survivors)
        total, rounds = self.budget * len(remaining), max(1, (len(remaining) - 1).bit_length())
        done = 0
        for _ in range(rounds):
            share = max(trials, total // (rounds * max(1, len(remaining))))
            done = min(done + share, self.most_trials(trials))
            missing = ask_for(remaining, done)
            if missing:
                return missing
            remaining = rank(remaining, done)[: (len(remaining) + 1) // 2]
        return {}
