"""Random search, the baseline for all other optimizers."""

from dataclasses import dataclass
from typing import Annotated

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, checked
from evoros.optimizer.history import FitnessSearch, FixedSampler
from evoros.optimizer.protocol import BundledOptimizer, Goals, Search, Space


@dataclass(frozen=True)
@checked
class RandomSearch(BundledOptimizer):
    """Draws each generation uniformly from the whole space; keeps the best design."""

    population_size: Annotated[int, COUNT] = 16

    def start(self, space: Space, goals: Goals, rng: Generator) -> Search:

        def propose() -> list[Array]:
            return list(rng.random((self.population_size, space.size)))

        return FitnessSearch(FixedSampler("random", propose))
