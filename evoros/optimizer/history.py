"""Code shared by searches: individuals and scores, samplers, archives, levels of genes."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import COUNT
from evoros.base.errors import InputError
from evoros.optimizer.protocol import Candidate, Goals, Individual, Score, Space, check_scores

if TYPE_CHECKING:
    from ribs.archives import GridArchive


class History:
    """The individuals of a search with their scores, by id."""

    def __init__(self) -> None:
        self.asked: list[Individual] = []  # individuals of the current generation
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
        """Record valid scores; return True if any earlier score has changed."""
        check_scores(scores, self.asked)
        known = {index: self.scores[index] for index in scores if index in self.scores}
        self.scores |= {index: scores[index] for index in sorted(scores)}
        return any(scores[index] != score for index, score in known.items())

    @property
    def fitness(self) -> list[float]:
        """The fitness of the current generation, in the order of ``asked``."""
        return [float(self.scores[individual.id].fitness) for individual in self.asked]

    def rank(self, ids: Iterable[int]) -> list[Individual]:
        """Return individuals, fittest first, and older first among equals."""
        ranked = sorted(ids, key=lambda index: (-self.scores[index].fitness, index))
        return [self.individuals[index] for index in ranked]

    def tabulate(self, shown: Iterable[int], survivors: Iterable[int]) -> list[Candidate]:
        """Return table rows for earlier individuals ``shown`` and for the current generation."""
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
    """Return a read-only copy of a genome, clipped to the unit cube."""
    frozen = genome.clip(0.0, 1.0).astype(float)
    frozen.flags.writeable = False
    return frozen


def draw_seed(rng: Generator) -> int:
    """Draw a seed for a library's random generator."""
    return int(rng.integers(2**31))


def list_categories(space: Space) -> list[int]:
    """Return the categorical genes, whose levels have no order."""
    aspects = (aspect for block in space.blocks for aspect in block.aspects)
    return sorted(gene for aspect in aspects for gene in aspect.categorical)


def place_level(level: Array | int, count: Array | int) -> Array:
    """Return the gene value at the centre of one of ``count`` levels."""
    return np.asarray((np.asarray(level) + 0.5) / np.asarray(count), dtype=float)


class Sampler(Protocol):
    """Proposes generations of genomes."""

    @property
    def name(self) -> str:
        """The operator recorded for individuals of this sampler."""

    def propose(self) -> Sequence[Array]:
        """Return the genomes (size,) of the next generation, to be clipped to 0..1."""

    def learn(self, history: History, changed: bool) -> None:
        """Learn from the generation's scores; ``changed`` tells if earlier scores have changed."""


@dataclass(frozen=True)
class FixedSampler:
    """A sampler that does not learn from scores."""

    name: str
    propose: Callable[[], Sequence[Array]]

    def learn(self, history: History, changed: bool) -> None:
        pass


class FitnessSearch:
    """A search that keeps the best of all designs proposed by a sampler."""

    def __init__(self, sampler: Sampler, first: str | None = None) -> None:
        """Start; the operator of the first generation is ``first`` (default: the sampler's)."""
        self._sampler, self._history = sampler, History()
        self._history.ask(sampler.propose(), first or sampler.name)

    def ask(self) -> list[Individual]:
        """Return the individuals of the current generation."""
        return self._history.asked

    def tell(self, scores: Mapping[int, Score]) -> list[Candidate]:
        """Record scores, and make the sampler propose the next generation."""
        before = [champion.id for champion in self.champions()]
        changed = self._history.tell(scores)
        best = [champion.id for champion in self.champions()]
        table = self._history.tabulate([*scores, *before, *best], best)
        self._sampler.learn(self._history, changed)
        self._history.ask(self._sampler.propose(), self._sampler.name)
        return table

    def champions(self) -> list[Individual]:
        """Return the fittest individual so far, the older one among equals."""
        return self._history.rank(self._history.scores)[:1]


MOST_CELLS = 1_000_000
CELLS = replace(COUNT, limit=MOST_CELLS)


def create_archive(
    space: Space, goals: Goals, cells: int, rng: Generator, **settings: Any
) -> "GridArchive":
    """Create an archive with ``cells`` cells per descriptor; edge cells include outliers."""
    from ribs.archives import GridArchive

    count = len(goals.descriptors)
    if not count:
        raise InputError(
            "descriptors: the archive needs at least one measure as a descriptor; "
            "for example, add +measure@descriptors.front=front_coverage"
        )
    if cells**count > MOST_CELLS:
        raise InputError(
            f"optimizer.cells: the archive must have at most {MOST_CELLS} cells, not "
            f"{cells}^{count}; lower optimizer.cells, or remove descriptors"
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
    """A search that keeps the best proposal of a sampler in each cell of an archive."""

    def __init__(self, archive: "GridArchive", sampler: Sampler) -> None:
        super().__init__(sampler, "initial")
        self._archive = archive

    def tell(self, scores: Mapping[int, Score]) -> list[Candidate]:
        """Return rows for scored individuals and the best elite; ``survived`` is 1 for elites."""
        changed = self._history.tell(scores)
        self._fill(changed)
        elites = [individual.id for individual in self.champions()]
        table = self._history.tabulate([*scores, *elites[:1]], elites)
        self._sampler.learn(self._history, changed)
        self._history.ask(self._sampler.propose(), self._sampler.name)
        return table

    def _fill(self, anew: bool) -> None:
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
        return self._history.rank(map(int, self._archive.data("id")))
