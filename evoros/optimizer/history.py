"""The individuals and scores of a search, and a search by fitness alone."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import COUNT
from evoros.base.errors import InputError
from evoros.optimizer.library import draw_seed
from evoros.optimizer.protocol import Candidate, Goals, Individual, Score, Space, check_scores

if TYPE_CHECKING:
    from ribs.archives import GridArchive


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
        """Return individuals, fittest first; of equal individuals, the older comes first."""
        ranked = sorted(ids, key=lambda index: (-self.scores[index].fitness, index))
        return [self.individuals[index] for index in ranked]

    def tabulate(self, shown: Iterable[int], survivors: Iterable[int]) -> list[Candidate]:
        """Return table rows for the earlier individuals ``shown``, then for this generation.

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


MOST_CELLS = 1_000_000
CELLS = replace(COUNT, limit=MOST_CELLS)


def create_archive(
    space: Space, goals: Goals, cells: int, rng: Generator, **settings: Any
) -> "GridArchive":
    """Create an archive of ``cells`` along each descriptor; outliers go to the edge cells.

    Raises:
        InputError: there are no descriptors, or too many cells.
    """
    from ribs.archives import GridArchive

    count = len(goals.descriptors)
    if not count:
        raise InputError(
            "descriptors: must have at least one measure that divides the archive, not none; "
            "add for example +measure@descriptors.front=front_coverage"
        )
    if cells**count > MOST_CELLS:
        raise InputError(
            f"optimizer.cells: must give an archive of at most {MOST_CELLS} cells, not "
            f"{cells} to the power of {count} descriptors; lower it, or remove descriptors"
        )
    return GridArchive(
        solution_dim=space.size,
        dims=[cells] * count,
        ranges=list(goals.descriptors.values()),
        seed=draw_seed(rng),
        extra_fields={"id": ((), np.int64)},
        **settings,
    )


class ArchiveSearch(FitnessSearch):
    """A search that keeps a sampler's best proposal in each cell of an archive."""

    def __init__(self, archive: "GridArchive", sampler: Sampler) -> None:
        super().__init__(sampler, "initial")
        self._archive = archive

    def tell(self, scores: Mapping[int, Score]) -> list[Candidate]:
        """Return the rows of the scored individuals and of the best; elites have ``survived`` 1.

        Raises:
            InputError: a score is missing, or has NaN.
        """
        changed = self._history.tell(scores)
        self._fill(changed)
        elites = [individual.id for individual in self.champions()]
        table = self._history.tabulate([*scores, *elites[:1]], elites)
        self._sampler.learn(self._history, changed)
        self._history.ask(self._sampler.propose(), self._sampler.name)
        return table

    def _fill(self, anew: bool) -> None:
        """Add this generation to the archive, or refill it with all individuals."""
        individuals = self._history.asked
        if anew:
            self._archive.clear()
            individuals = list(self._history.individuals.values())
        told = [self._history.scores[individual.id] for individual in individuals]
        self._archive.add(
            np.array([individual.genome for individual in individuals]),
            np.array([score.fitness for score in told]),
            np.array([score.descriptor for score in told]),
            id=np.array([individual.id for individual in individuals]),
        )

    def champions(self) -> list[Individual]:
        """Return the elites, the fittest first."""
        return self._history.rank(map(int, self._archive.data("id")))
