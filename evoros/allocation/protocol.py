"""The protocol of allocations, and the standing of a design after its trials so far."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from evoros.base.combining import Combine, mean


@dataclass(frozen=True)
class Standing:
    """A design that may get trials: a new one, or a survivor of earlier generations."""

    id: int
    scores: tuple[float, ...] = ()  # of its trials in this contest, in the order of the trials
    earlier: tuple[float, ...] = ()  # of its trials in earlier generations; empty: it is new
    combine: Combine = mean  # of the experiment's fitness

    @property
    def new(self) -> bool:
        """Whether it has never been scored before this contest."""
        return not self.earlier

    def fitness(self, trials: int) -> float:
        """The fitness over its life, of this contest only the first so many trials."""
        return self.combine((*self.earlier, *self.scores[:trials]))


@runtime_checkable
class Allocation(Protocol):
    """Decides in rounds which designs of a generation get how many further trials."""

    def most_trials(self, trials: int) -> int:
        """Return the maximum number of trials that a design gets in one generation."""
        ...

    def next_round(self, standings: Sequence[Standing], trials: int) -> Mapping[int, int]:
        """Return the further trials of each design that gets some, by its id; empty: none does.

        ``trials`` is the experiment's key of that name. The same standings must give the same
        round, because resuming asks again. Under common random numbers the first trial of every
        design in a generation meets the same draws, and so does each later one.
        """
        ...


def choose_entrants(standings: Sequence[Standing], survivors: int) -> list[Standing]:
    """Return the new designs and the best survivors of earlier generations, at most so many."""
    old = rank((standing for standing in standings if not standing.new), 0)
    return [*(standing for standing in standings if standing.new), *old[:survivors]]


def rank(standings: Iterable[Standing], trials: int) -> list[Standing]:
    """Sort by the fitness over so many trials, the best first; of equals the first stays first."""
    return sorted(standings, key=lambda standing: -standing.fitness(trials))


def ask_for(standings: Iterable[Standing], trials: int) -> dict[int, int]:
    """Return the number of trials that each design lacks to so many, by its id."""
    lacks = {standing.id: trials - len(standing.scores) for standing in standings}
    return {design: lack for design, lack in lacks.items() if lack > 0}


def cap_fitness(fitness: Mapping[int, float], rounds: Sequence[Iterable[int]]) -> dict[int, float]:
    """Return the fitness in which no design ranks above those that stayed in longer.

    Means over few trials spread more than means over many, so the best of those that left early
    would otherwise pass for the best of all. ``rounds`` has the ids of each round, in order.
    """
    capped = dict(fitness)
    for last in range(len(rounds) - 1, 0, -1):
        stayed = set(rounds[last])
        floor = min(capped[design] for design in stayed)
        for design in set(rounds[last - 1]) - stayed:
            capped[design] = min(capped[design], floor)
    return capped
