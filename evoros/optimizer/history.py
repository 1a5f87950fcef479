"""The individuals and scores of a search, and a search by fitness alone."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

from evoros.base.arrays import Array
from evoros.optimizer.protocol import Candidate, Individual, Score, check_scores


class History:
    """The individuals of a search and their scores by id."""

    def __init__(self) -> None:
        self.asked: list[Individual] = []  # individuals of this generation
        self.individuals: dict[int, Individual] = {}
        self.scores: dict[int, Score] = {}

    def ask(self, genomes: Sequence[Array], operator: str) -> None:
        """Create the next generation from genomes (size,), clipped to 0..1."""
        start = len(self.individuals)
        self.asked = [
            Individual(index, freeze(genome), (), operator)
            for index, genome in enumerate(genomes, start)
        ]
        self.individuals |= {individual.id: individual for individual in self.asked}

    def tell(self, scores: Mapping[int, Score]) -> bool:
        """Record scores; return True if any score of an earlier generation changed.

        Raises:
            InputError: a score is missing or has NaN; nothing is recorded.
        """
        check_scores(scores, self.asked)
        known = {index: self.scores[index] for index in scores if index in self.scores}
        self.scores |= {index: scores[index] for index in sorted(scores)}
        return any(scores[index] != score for index, score in known.items())

    @property
    def fitness(self) -> list[float]:
        """The fitness of this generation, in the order of ``asked``."""
        return [float(self.scores[individual.id].fitness) for individual in self.asked]

    def rank(self, ids: Iterable[int]) -> list[Individual]:
        """Return individuals, fittest first; ties put the older first."""
        ranked = sorted(ids, key=lambda index: (-self.scores[index].fitness, index))
        return [self.individuals[index] for index in ranked]

    def tabulate(self, shown: Iterable[int], survivors: Iterable[int]) -> list[Candidate]:
        """Return the rows of earlier ``shown`` individuals and then of this generation.

        The column ``survived`` is 1 for ``survivors`` and 0 otherwise.
        """
        kept = set(survivors)
        asked = {individual.id for individual in self.asked}
        earlier = sorted(set(shown) - asked)
        return [
            Candidate(
                self.individuals[index],
                self.individuals[index].operator if index in asked else "survivor",
                float(self.scores[index].fitness),
                int(index in kept),
            )
            for index in (*earlier, *sorted(asked))
        ]


def freeze(genome: Array) -> Array:
    """Return a read-only copy within the unit cube."""
    frozen = genome.clip(0.0, 1.0).astype(float)
    frozen.flags.writeable = False
    return frozen


class Sampler(Protocol):
    """Proposes generations of genomes."""

    @property
    def name(self) -> str:
        """The operator of the sampler's individuals in tables."""

    def propose(self) -> Sequence[Array]:
        """Return the genomes (size,) of a generation, to be clipped to 0..1."""

    def learn(self, history: History, changed: bool) -> None:
        """Learn the scores of the generation; ``changed`` if any earlier score changed."""


class FitnessSearch:
    """A search that keeps the best of all proposals of a sampler."""

    def __init__(self, sampler: Sampler, first: str | None = None) -> None:
        """Start with an operator ``first`` in the first generation, by default the sampler's."""
        self._sampler, self._history = sampler, History()
        self._history.ask(sampler.propose(), first or sampler.name)

    def ask(self) -> list[Individual]:
        """Return the individuals of this generation."""
        return self._history.asked

    def tell(self, scores: Mapping[int, Score]) -> list[Candidate]:
        """Record scores, and let the sampler propose the next generation.

        Raises:
            InputError: a score is missing or has NaN.
        """
        before = [champion.id for champion in self.champions()]
        changed = self._history.tell(scores)
        best = [champion.id for champion in self.champions()]
        table = self._history.tabulate([*scores, *before, *best], best)
        self._sampler.learn(self._history, changed)
        self._history.ask(self._sampler.propose(), self._sampler.name)
        return table

    def champions(self) -> list[Individual]:
        """Return the fittest individual so far; ties put the older first."""
        return self._history.rank(self._history.scores)[:1]
