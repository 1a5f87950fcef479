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
        """How its individuals are made, for tables."""
        ...

    def propose(self) -> Sequence[Array]:
        """Return the genomes (size,) of a generation; numbers beyond 0..1 are moved to the ends."""
        ...

    def learn(self, history: History, changed: bool) -> None:
        """Learn the scores of the generation, and that earlier ones have ``changed``."""
        ...


class FitnessSearch:
    """Keeps what a sampler has proposed, and the best of all."""

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
        """Return the fittest so far."""
        return [] if self._history.best is None else [self._history.best]
