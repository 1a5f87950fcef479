"""Random search, the baseline for all other optimizers."""

from dataclasses import dataclass
from typing import Annotated

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, WHOLE, checked
from evoros.optimizer.history import FitnessSearch, History
from evoros.optimizer.protocol import Goals, Optimizer, Search, Space


@dataclass(frozen=True)
@checked
class RandomSearch(Optimizer):
    """Draws each generation uniformly from the whole space, and keeps the best design so far."""

    population_size: Annotated[int, COUNT] = 16
    generations: Annotated[int, COUNT] = 25
    validation_trials: Annotated[int, WHOLE] = 5  # fresh trials for each generation's best design

    def start(self, space: Space, goals: Goals, rng: Generator) -> Search:
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
        """Do nothing."""
