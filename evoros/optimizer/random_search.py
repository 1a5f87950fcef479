"""Random search: the baseline that any other optimizer has to beat."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, WHOLE, checked
from evoros.optimizer.protocol import Candidate, Individual, Search, Space, check_fitness


@dataclass(frozen=True)
@checked
class RandomSearch:
    """Each generation is drawn uniformly from the whole space; only the best so far is kept."""

    population_size: Annotated[int, COUNT] = 16
    generations: Annotated[int, COUNT] = 25
    validation_trials: Annotated[int, WHOLE] = 5  # of each generation's best, on fresh draws

    def start(self, space: Space, rng: Generator) -> Search:
        """A fresh search; it draws from ``rng`` and from nothing else."""
        return _RandomSearch(self.population_size, space, rng)


class _RandomSearch:
    def __init__(self, population_size: int, space: Space, rng: Generator) -> None:
        self._population_size, self._space, self._rng = population_size, space, rng
        self._best: Candidate | None = None
        self._created = 0
        self._draw()

    def ask(self) -> list[Individual]:
        return self._asked

    def tell(self, fitness: Sequence[float]) -> list[Candidate]:
        check_fitness(fitness, self._asked)
        table = [] if self._best is None else [self._best]
        table += [
            Candidate(individual, individual.operator, value, 0)
            for individual, value in zip(self._asked, fitness, strict=True)
        ]
        best = max(range(len(table)), key=lambda row: table[row].fitness)
        chosen = table[best]
        self._best = Candidate(chosen.individual, "survivor", chosen.fitness, 0)
        table[best] = Candidate(chosen.individual, chosen.operator, chosen.fitness, 1)
        self._draw()
        return table

    def _draw(self) -> None:
        ids = range(self._created, self._created + self._population_size)
        self._asked = [Individual(i, self._genome(), (), "random") for i in ids]
        self._created = ids.stop

    def _genome(self) -> Array:
        genome = self._rng.random(self._space.size)
        genome.flags.writeable = False
        return genome
