"""Random search: the baseline that every other optimizer has to beat."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, WHOLE, checked
from evoros.optimizer.protocol import Candidate, Individual, Score, Search, Space, check_scores


@dataclass(frozen=True)
@checked
class RandomSearch:
    """Draws each generation uniformly from the whole space and keeps only the best so far."""

    population_size: Annotated[int, COUNT] = 16
    generations: Annotated[int, COUNT] = 25
    validation_trials: Annotated[int, WHOLE] = 5  # of each generation's best, on fresh draws

    def start(self, space: Space, rng: Generator) -> Search:
        """Start a search, which draws from ``rng`` and from nothing else."""
        return _RandomSearch(self.population_size, space, rng)


class _RandomSearch:
    def __init__(self, population_size: int, space: Space, rng: Generator) -> None:
        self._population_size, self._space, self._rng = population_size, space, rng
        self._best: Candidate | None = None
        self._created = 0
        self._draw_generation()

    def ask(self) -> list[Individual]:
        return self._asked

    def tell(self, scores: Mapping[int, Score]) -> list[Candidate]:
        check_scores(scores, self._asked)
        table = [
            Candidate(individual, individual.operator, float(scores[individual.id].fitness), 0)
            for individual in self._asked
        ]
        if self._best is not None:
            table.insert(0, self._best.rescored(scores))
        row = max(range(len(table)), key=lambda row: table[row].fitness)
        best = table[row]
        self._best = replace(best, operator="survivor")
        table[row] = replace(best, survived=1)
        self._draw_generation()
        return table

    def champions(self) -> list[Individual]:
        return [] if self._best is None else [self._best.individual]

    def _draw_generation(self) -> None:
        ids = range(self._created, self._created + self._population_size)
        self._asked = [Individual(i, self._draw_genome(), (), "random") for i in ids]
        self._created = ids.stop

    def _draw_genome(self) -> Array:
        genome = self._rng.random(self._space.size)
        genome.flags.writeable = False
        return genome
