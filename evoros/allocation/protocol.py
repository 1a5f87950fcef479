"""The base class of allocations, and the scores of designs so far."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from evoros.base.combining import Combine, mean


@dataclass(frozen=True)
class Standing:
    """A candidate for trials: a new design, or a survivor of earlier generations."""

    id: int
    scores: tuple[float, ...] = ()  # scores of trials in this contest, in order
    earlier: tuple[float, ...] = ()  # scores in earlier generations; empty for a new design
    combine: Combine = mean  # the experiment's function that combines scores

    @property
    def new(self) -> bool:
        """True if the design has no scores from earlier generations."""
        return not self.earlier

    def fitness(self, trials: int, compared: int | None = None) -> float:
        """Combine earlier and the first ``trials`` scores, as expected from ``compared`` trials."""
        return self.combine((*self.earlier, *self.scores[:trials]), compared)


class Allocation(ABC):
    """Distributes trials among the designs of a generation, in rounds."""

    @abstractmethod
    def most_trials(self, trials: int) -> int:
        """Return the maximum number of trials of a design in one generation."""

    @abstractmethod
    def next_round(self, standings: Sequence[Standing], trials: int) -> Mapping[int, int]:
        """Return the number of further trials by design id; {} ends the contest.

        ``trials`` is the experiment's key ``trials``. The result must depend on the arguments only,
        because a resumed run asks again. With common random numbers, trial k of all designs in a
        generation has the same draws.
        """


def choose_entrants(standings: Sequence[Standing], survivors: int) -> list[Standing]:
    """Return the new designs and up to ``survivors`` of the best earlier designs."""
    old = rank((standing for standing in standings if not standing.new), 0)
    return [*(standing for standing in standings if standing.new), *old[:survivors]]


def rank(standings: Iterable[Standing], trials: int) -> list[Standing]:
    """Sort by fitness after ``trials``, best first, compared at the fewest trials of any design."""
    listed = list(standings)
    shortest = min((len(item.earlier) + len(item.scores[:trials]) for item in listed), default=0)
    return sorted(listed, key=lambda standing: -standing.fitness(trials, shortest))


def ask_for(standings: Iterable[Standing], trials: int) -> dict[int, int]:
    """Map the id of each design with fewer than ``trials`` trials to the number it lacks."""
    lacks = {standing.id: trials - len(standing.scores) for standing in standings}
    return {design: lack for design, lack in lacks.items() if lack > 0}


def cap_fitness(fitness: Mapping[int, float], rounds: Sequence[Iterable[int]]) -> dict[int, float]:
    """Cap the fitness so that no design ranks above designs that remained for more ``rounds``."""
    capped = dict(fitness)
    for last in range(len(rounds) - 1, 0, -1):
        stayed = set(rounds[last])
        floor = min(capped[design] for design in stayed)
        for design in set(rounds[last - 1]) - stayed:
            capped[design] = min(capped[design], floor)
    return capped
