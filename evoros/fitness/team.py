"""The fitness of several robots."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import fmean

from evoros.fitness.naming import name_fitness
from evoros.fitness.protocol import Fitness
from evoros.mission.outcome import Outcome


@dataclass(frozen=True)
class TeamFitness:
    """The mean of what ``fitness`` gives the first robot and each of the ``scored`` others."""

    fitness: Fitness
    scored: tuple[int, ...]  # places of those others among ``Outcome.others``

    @property
    def title(self) -> str:
        """Its name in figures."""
        return f"{name_fitness(self.fitness).title}, mean of the robots"

    @property
    def unit(self) -> str:
        """The unit of what it averages."""
        return name_fitness(self.fitness).unit

    def score(self, outcomes: Sequence[Outcome]) -> float:
        """Return the mean score of the robots in a trial."""
        return self._average(self.fitness.score, outcomes)

    def worst(self, outcomes: Sequence[Outcome]) -> float:
        """Return the mean of the worst scores of the robots."""
        return self._average(self.fitness.worst, outcomes)

    def _average(
        self, score: Callable[[Sequence[Outcome]], float], outcomes: Sequence[Outcome]
    ) -> float:
        others = ([outcome.others[place] for outcome in outcomes] for place in self.scored)
        return fmean(map(score, (outcomes, *others)))
