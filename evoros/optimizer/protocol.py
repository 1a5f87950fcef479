"""The interface of optimizers: individuals, search spaces, ask and tell."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, WHOLE, Rule, ask
from evoros.base.errors import InputError


@dataclass(frozen=True, eq=False, slots=True)
class Individual:
    """A genome in the unit cube of the search space, with its origin."""

    id: int  # unique in a run, increasing by creation
    genome: Array  # (space.size,), values from 0 to 1
    parents: tuple[int, ...]
    operator: str  # operator that created the individual, such as initial, crossover or mutation


@dataclass(frozen=True, slots=True)
class Score:
    """The fitness and other measures of a design."""

    fitness: float  # maximized
    objectives: tuple[float, ...] = ()  # maximized, in the order of ``Goals.objectives``
    descriptor: tuple[float, ...] = ()  # ordered like ``Goals.descriptors``


@dataclass(frozen=True)
class Goals:
    """The measures in a score besides the fitness."""

    objectives: tuple[str, ...] = ()  # names of the objectives
    descriptors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Minimum and maximum of each descriptor by name; designs may be outside."""


@dataclass(frozen=True)
class Candidate:
    """A row in the table of a generation."""

    individual: Individual
    operator: str  # operator that added the candidate, such as survivor, clone or crossover
    fitness: float
    survived: int  # number of copies in the next population

    def rescored(self, scores: Mapping[int, Score]) -> "Candidate":
        """Return the candidate with the fitness of its new score, if it has one."""
        score = scores.get(self.individual.id)
        return self if score is None else replace(self, fitness=float(score.fitness))


class Search(Protocol):
    """A started optimizer, used in cycles: ``ask``, evaluate the individuals, ``tell``."""

    def ask(self) -> Sequence[Individual]:
        """Return the individuals of the next generation to evaluate."""

    def tell(self, scores: Mapping[int, Score]) -> Sequence[Candidate]:
        """Record scores by id, and return the table of the generation.

        ``scores`` covers all individuals from ``ask``, and earlier individuals whose scores have
        changed.
        """

    def champions(self) -> Sequence[Individual]:
        """Return the design, front or archive found so far, best first."""


@dataclass(frozen=True)
class Aspect:
    """Genes that change together, such as the position or the angle of a sensor."""

    name: str
    continuous: tuple[int, ...]  # indices into the genome
    categorical: tuple[int, ...] = ()


@dataclass(frozen=True)
class Block:
    """Genes that are inherited together, such as all genes of a sensor."""

    name: str
    aspects: tuple[Aspect, ...]

    @property
    def genes(self) -> tuple[int, ...]:
        """The indices of all genes in the block."""
        return tuple(i for part in self.aspects for i in (*part.categorical, *part.continuous))

    def move(self, index: Callable[[int], int]) -> "Block":
        """Return this block with ``index`` applied to each gene index."""
        aspects = []
        for part in self.aspects:
            genes = (tuple(map(index, kind)) for kind in (part.continuous, part.categorical))
            aspects.append(Aspect(part.name, *genes))
        return Block(self.name, tuple(aspects))


class Space(Protocol):
    """The search space of an optimizer: a unit cube with grouped genes."""

    @property
    def size(self) -> int:
        """The number of genes."""

    @property
    def blocks(self) -> tuple[Block, ...]:
        """All genes in disjoint blocks, in the order used for crossover cuts."""

    @property
    def levels(self) -> Mapping[int, int]:
        """The number of levels (at least two) of each discrete gene, by gene index.

        Levels are categories if an aspect lists the gene as ``categorical``, and whole numbers
        otherwise. Level k of n covers gene values from k/n to (k + 1)/n.
        """

    def same(self, first: Array, second: Array, /) -> bool:
        """Return True if two genomes give the same design, so that one evaluation suffices."""


class View(NamedTuple):
    """The bearings seen by a sensor and by its twin, if any."""

    counts: NDArray[np.int64]  # (360,) sensors that see each bearing of ``robot/seen.py``
    price: float  # total price of the sensor and its twin
    place: str = ""  # name of a place for a single sensor; empty if several fit


@runtime_checkable
class CoveringSpace(Space, Protocol):
    """A search space that can compute the bearings seen by its sensors."""

    @property
    def slots(self) -> tuple[Block, ...]:
        """The genes of each placed sensor in mounting order; equal genes give equal sensors."""

    @property
    def number(self) -> tuple[int, int]:
        """The minimum and maximum number of mounted slots."""

    @property
    def number_gene(self) -> int | None:
        """The gene with a level per possible number of slots; None if the number is fixed."""

    def view(self, genome: Array, distance_m: float) -> tuple[list[View], View]:
        """Return a ``View`` per genome and slot, mounted or not, and one of the fixed sensors.

        Several robots with separate designs raise an InputError.
        """


class Optimizer(ABC):
    """Searches the unit cube of a design space."""

    generations: int  # number of generations of a run, including the first
    validation_trials: int  # fresh trials for each generation's best design; 0: none
    packages: Sequence[str] = ()  # packages of the search; a run records their versions

    @abstractmethod
    def start(self, space: Space, goals: Goals, rng: Generator) -> Search:
        """Start a search determined by ``rng``, because resuming a run replays the search.

        Unsupported spaces or goals, and packages that are not installed, raise an InputError.
        """


@dataclass(frozen=True, kw_only=True)
class BundledOptimizer(Optimizer):
    """An optimizer with the settings that all bundled optimizers share."""

    generations: Annotated[int, COUNT] = 25  # including the first generation
    validation_trials: Annotated[int, WHOLE] = 5  # fresh trials for each generation's best design


def require_genes(space: Space) -> None:
    """Raise an InputError if the space has no genes."""
    if not space.blocks:
        raise InputError(
            "design: there is nothing to evolve, because all values are constants; "
            "give a region or a gene a range, or choose optimizer=random_search"
        )


def check_scores(scores: Mapping[int, Score], asked: Sequence[Individual]) -> None:
    """Raise an InputError if an ``asked`` individual has no score, or a score is NaN."""
    missing = [individual.id for individual in asked if individual.id not in scores]
    if missing:
        raise InputError(
            f"scores: the individuals {missing} from ask() have no score; add their scores"
        )
    for design_id, score in scores.items():
        if any(map(math.isnan, (score.fitness, *score.objectives, *score.descriptor))):
            raise InputError(
                f"scores: fitness, objectives and descriptor must be numbers, not {score} for "
                f"individual {design_id}; correct the computation of these values"
            )


KEY = "optimizer"


@dataclass(frozen=True)
class AskedSearch:
    """Forwards calls to a search; raises an InputError for an invalid return value."""

    search: Search
    size: int  # number of genes
    known: set[int] = field(default_factory=set)  # ids of all individuals so far

    def ask(self) -> Sequence[Individual]:
        """Return the individuals of the next generation to evaluate."""
        text = f"a list of individuals with distinct ids and {self.size} genes from 0 to 1"
        asked: Sequence[Individual] = ask(KEY, self.search.ask, Rule(text, self._are_points))
        self.known.update(one.id for one in asked)
        return asked

    def tell(self, scores: Mapping[int, Score]) -> Sequence[Candidate]:
        """Record scores by id, and return the table of the generation."""
        rule = Rule("a non-empty list of candidates from ask()", self._are_candidates)
        table: Sequence[Candidate] = ask(KEY, self.search.tell, rule, scores)
        return table

    def champions(self) -> Sequence[Individual]:
        """Return the design, front or archive found so far, best first."""
        rule = Rule("a non-empty list of individuals from ask()", self._are_known)
        best: Sequence[Individual] = ask(KEY, self.search.champions, rule)
        return best

    def _are_points(self, value: object) -> bool:
        if not isinstance(value, list | tuple):
            return False
        ids = {one.id for one in value if isinstance(one, Individual)}
        return len(ids) == len(value) and all(self._is_point(one.genome) for one in value)

    def _is_point(self, genome: object) -> bool:
        if not isinstance(genome, np.ndarray) or genome.dtype.kind not in "fiu":
            return False
        return genome.shape == (self.size,) and bool(np.all((genome >= 0.0) & (genome <= 1.0)))

    def _are_candidates(self, value: object) -> bool:
        rows = value if isinstance(value, list | tuple) else ()
        candidates = [row.individual for row in rows if isinstance(row, Candidate)]
        return len(candidates) == len(rows) and self._are_known(candidates)

    def _are_known(self, value: object) -> bool:
        some = value if isinstance(value, list | tuple) else ()
        return bool(some) and all(isinstance(x, Individual) and x.id in self.known for x in some)
