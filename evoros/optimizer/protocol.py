"""The protocols of optimizers: individuals, the search space, ask and tell."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.checks import POSITIVE, Rule
from evoros.base.errors import InputError

STEP = Rule("a number greater than 0, at most 1", lambda v: POSITIVE.holds(v) and v <= 1)
"""For a step, as a share of the range of a gene."""


@dataclass(frozen=True, eq=False, slots=True)
class Individual:
    """One genome that needs evaluation: a vector of the unit cube of the search space."""

    id: int  # unique in a run, in the order of creation
    genome: Array  # (space.size,) 0..1
    parents: tuple[int, ...]
    operator: str  # how it was made: initial, crossover, mutation ...


@dataclass(frozen=True, slots=True)
class Score:
    """The fitness and the measures of a design."""

    fitness: float  # maximized
    objectives: tuple[float, ...] = ()  # maximized too, in the order of ``Goals.objectives``
    descriptor: tuple[float, ...] = ()  # in the order of ``Goals.descriptors``


@dataclass(frozen=True)
class Goals:
    """The measures that a score has besides the fitness."""

    objectives: tuple[str, ...] = ()  # their names
    descriptors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """The minimum and maximum of each, by its name; a design may lie beyond them."""


@dataclass(frozen=True)
class Candidate:
    """One row of a generation's table."""

    individual: Individual
    operator: str  # how this place in the candidate pool was filled: survivor, clone, crossover ...
    fitness: float
    survived: int  # how many copies of it are in the next population

    def rescored(self, scores: Mapping[int, Score]) -> "Candidate":
        """Return the candidate with its new score, if there is one."""
        score = scores.get(self.individual.id)
        return self if score is None else replace(self, fitness=float(score.fitness))


class Search(Protocol):
    """A started optimizer: ask, evaluate, tell."""

    def ask(self) -> Sequence[Individual]:
        """Return the individuals of the next generation that need evaluation."""

    def tell(self, scores: Mapping[int, Score]) -> Sequence[Candidate]:
        """Take the scores of individuals by their id; return the table of the generation.

        They are all individuals of ``ask``, and earlier ones whose score has changed.
        """

    def champions(self) -> Sequence[Individual]:
        """Return the design, front or archive that the search keeps, the best first."""


@dataclass(frozen=True)
class Aspect:
    """Genes that change together: the place of a sensor, or its angle."""

    name: str
    continuous: tuple[int, ...]  # indices into the genome
    categorical: tuple[int, ...] = ()


@dataclass(frozen=True)
class Block:
    """Genes that are inherited together: a sensor, or one evolved value."""

    name: str
    aspects: tuple[Aspect, ...]

    @property
    def genes(self) -> tuple[int, ...]:
        """The indices of all its genes."""
        return tuple(i for part in self.aspects for i in (*part.categorical, *part.continuous))

    def move(self, index: Callable[[int], int]) -> "Block":
        """Return this block with other indices of its genes."""
        aspects = (
            Aspect(
                part.name, tuple(map(index, part.continuous)), tuple(map(index, part.categorical))
            )
            for part in self.aspects
        )
        return Block(self.name, tuple(aspects))


class Space(Protocol):
    """The search space as an optimizer sees it: the unit cube, and which genes belong together."""

    @property
    def size(self) -> int:
        """The number of genes."""

    @property
    def blocks(self) -> tuple[Block, ...]:
        """All genes, each in one block, in the order in which a crossover may cut."""

    @property
    def levels(self) -> Mapping[int, int]:
        """The number of values, at least two, of each gene that has a few, by its index.

        They are categories, or whole numbers if no aspect has the gene as ``categorical``. Level k
        of n has the genes from k/n to (k + 1)/n.
        """

    def same(self, first: Array, second: Array, /) -> bool:
        """Whether two genomes are the same design, which needs only one evaluation."""


class View(NamedTuple):
    """What one sensor sees, together with its twin if it has one."""

    counts: NDArray[
        np.int64
    ]  # (360,) how many of them see each bearing, as ``robot/seen.py`` has them
    price: float  # of them together
    place: str = ""  # that carries one sensor: no other there is mounted; empty: none


@runtime_checkable
class CoveringSpace(Space, Protocol):
    """A search space that knows what placed sensors see."""

    @property
    def slots(self) -> tuple[Block, ...]:
        """The genes of each placed sensor, in the order in which sensors are mounted.

        A vector of genes in one slot is the same sensor in any other.
        """

    @property
    def number(self) -> tuple[int, int]:
        """The minimum and the maximum number of mounted slots."""

    @property
    def number_gene(self) -> int | None:
        """The gene of this number, whose levels they are; None if it does not evolve."""

    def view(self, genome: Array, distance_m: float) -> tuple[list[View], View]:
        """Return what each slot sees at a distance, mounted or not, and what fixed sensors see.

        Raises:
            InputError: several robots have a design of their own.
        """


@runtime_checkable
class Optimizer(Protocol):
    """Searches the unit cube of a design space."""

    @property
    def generations(self) -> int:
        """The number of generations of a run, the first one included."""

    @property
    def validation_trials(self) -> int:
        """The number of fresh trials of each generation's best design; 0: no validation."""

    def start(self, space: Space, goals: Goals, rng: Generator) -> Search:
        """Start a search. The same generator must give the same search: resuming replays it.

        Raises:
            InputError: this optimizer cannot search this space or for these goals, or its package
                is not installed.
        """


@runtime_checkable
class PackagedOptimizer(Protocol):
    """An optimizer whose search depends on packages, whose versions a run records."""

    @property
    def packages(self) -> Sequence[str]:
        """Their names."""


def require_genes(space: Space) -> None:
    """Raise an InputError if the space has no genes."""
    if not space.blocks:
        raise InputError(
            "design: must leave something to evolve, not only constants; "
            "give a region or a gene a range, or choose optimizer=random_search"
        )


def check_scores(scores: Mapping[int, Score], asked: Sequence[Individual]) -> None:
    """Raise an InputError if an ``asked`` individual has no score, or a score has NaN."""
    missing = [individual.id for individual in asked if individual.id not in scores]
    if missing:
        raise InputError(
            f"scores: must have one for each individual of ask(), and has none for {missing}; "
            "add them"
        )
    for design_id, score in scores.items():
        if any(map(math.isnan, (score.fitness, *score.objectives, *score.descriptor))):
            raise InputError(
                f"scores: the fitness, objectives and descriptor must be numbers, not {score} of "
                f"individual {design_id}; correct their computation"
            )
