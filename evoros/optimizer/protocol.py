"""The protocols of optimizers: individuals, the search space, ask and tell."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.errors import InputError


@dataclass(frozen=True, eq=False)
class Individual:
    """One genome that needs evaluation: a vector of the unit cube of the search space."""

    id: int  # unique in a run, in the order of creation
    genome: Array  # (space.size,) 0..1
    parents: tuple[int, ...]
    operator: str  # how it was made: initial, crossover, mutation ...


@dataclass(frozen=True)
class Candidate:
    """One row of a generation's table."""

    individual: Individual
    operator: str  # how this place in the candidate pool was filled: survivor, clone, crossover ...
    fitness: float
    survived: int  # how many copies of it are in the next population


class Search(Protocol):
    """A started optimizer: ask, evaluate, tell. Fitness is maximized."""

    def ask(self) -> Sequence[Individual]:
        """Return the individuals of the next generation that need evaluation."""
        ...

    def tell(self, fitness: Sequence[float]) -> Sequence[Candidate]:
        """Take the fitness of these individuals, in order; return the table of the generation."""
        ...


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


class Space(Protocol):
    """The search space as an optimizer sees it: the unit cube, and which genes belong together."""

    @property
    def size(self) -> int:
        """The number of genes."""
        ...

    @property
    def blocks(self) -> tuple[Block, ...]:
        """All genes, each in one block, in the order in which a crossover may cut."""
        ...

    def same(self, first: Array, second: Array, /) -> bool:
        """Whether two genomes are the same design, which needs only one evaluation."""
        ...


@runtime_checkable
class Optimizer(Protocol):
    """Searches the unit cube of a design space."""

    @property
    def generations(self) -> int:
        """The number of generations of a run, the first one included."""
        ...

    @property
    def validation_trials(self) -> int:
        """The number of fresh trials of each generation's best design; 0: no validation."""
        ...

    def start(self, space: Space, rng: Generator) -> Search:
        """Start a search. The same generator must give the same search: resuming replays it."""
        ...


def check_fitness(fitness: Sequence[float], asked: Sequence[Individual]) -> None:
    """Check that there is one number, not NaN, for each individual of ``ask``.

    Raises:
        InputError: a number is missing, or NaN.
    """
    if len(fitness) != len(asked) or any(map(math.isnan, fitness)):
        raise InputError(
            f"fitness: must be {len(asked)} numbers, not {list(fitness)}; "
            f"give one for each individual of ask()"
        )
