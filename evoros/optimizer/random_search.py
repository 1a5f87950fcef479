"""Random search: the baseline that every other optimizer has to beat."""

from dataclasses import dataclass
from typing import Annotated

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, WHOLE, checked
from evoros.optimizer.fitness_search import FitnessSearch
from evoros.optimizer.history import History
from evoros.optimizer.protocol import Goals, Search, Space


@dataclass(frozen=True)
@checked
class RandomSearch:
    """Draws each generation uniformly from the whole space and keeps only the best so far."""

    population_size: Annotated[int, COUNT] = 16
    generations: Annotated[int, COUNT] = 25
    validation_trials: Annotated[int, WHOLE] = 5  # of each generation's best, on fresh draws

    def start(self, space: Space, goals: Goals, rng: Generator) -> Search:
        """Start a search, which draws from ``rng`` and from nothing else."""
        return FitnessSearch(_Uniform(self.population_size, space.size, rng))


@dataclass(frozen=True)
class _Uniform:
    population_size: int
    size: int
    rng: Generator
    name: str = "random"

    def propose(self) -> list[Array]:
        return [self.rng.random(self.size) for _ in range(self.population_size)]

    def learn(self, history: History, changed: bool) -> None:
        """Learn nothing."""
