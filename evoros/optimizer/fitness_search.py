"""A search by fitness alone, from a sampler that proposes genomes and learns their fitness."""

from collections.abc import Mapping, Sequence
from typing import Protocol

from evoros.base.arrays import Array
from evoros.optimizer.history import History
from evoros.optimizer.protocol import Candidate, Individual, Score


class Sampler(Protocol):
    """Proposes one generation after another."""

    @property
    def name(self) -> str:
        """The operator of its individuals in tables."""

    def propose(self) -> Sequence[Array]:
        """Return the genomes (size,) of a generation; values beyond 0..1 are clipped."""

    def learn(self, history: History, changed: bool) -> None:
        """Learn the scores of the generation, and whether earlier ones have ``changed``."""


class FitnessSearch:
    """A search that keeps the best of all proposals of a sampler."""

    def __init__(self, sampler: Sampler) -> None:
        self._sampler = sampler
        self._history = History()
        self._history.ask(sampler.propose(), sampler.name)

    def ask(self) -> list[Individual]:
        """Return the individuals of this generation."""
        return self._history.asked

    def tell(self, scores: Mapping[int, Score]) -> list[Candidate]:
        """Take the scores of individuals, and let the sampler propose the next generation.

        Raises:
            InputError: a score is missing, or has NaN.
        """
        before = [champion.id for champion in self.champions()]
        changed = self._history.tell(scores)
        best = [champion.id for champion in self.champions()]
        table = self._history.tabulate([*scores, *before, *best], best)
        self._sampler.learn(self._history, changed)
        self._history.ask(self._sampler.propose(), self._sampler.name)
        return table

    def champions(self) -> list[Individual]:
        """Return the fittest so far; of equals, the first."""
        return self._history.rank(self._history.scores)[:1]
