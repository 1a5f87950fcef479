"""The vocabulary between an optimizer and the rest: individuals, the search space, ask and tell.

Imports numpy and the standard library only.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.errors import InputError


@dataclass(frozen=True, eq=False)
class Individual:
    """One genome that needs evaluation. ``genome`` lies in the unit cube of the design space."""

    id: int  # unique in a run, in the order of creation
    genome: Array
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
        """The individuals that the next generation needs evaluated."""
        ...

    def tell(self, fitness: Sequence[float]) -> Sequence[Candidate]:
        """Take the fitness of the asked individuals, in order; returns the generation's table."""
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
        """The indices of all of them."""
        return tuple(i for each in self.aspects for i in (*each.categorical, *each.continuous))


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

    def same(self, one: Array, other: Array, /) -> bool:
        """Whether two genomes are equal designs, of which only one needs an evaluation."""
        ...


@runtime_checkable
class Optimizer(Protocol):
    """Searches the unit cube of a design space."""

    @property
    def generations(self) -> int:
        """How many generations a run has, the first one included."""
        ...

    @property
    def validation_trials(self) -> int:
        """On how many fresh draws each generation's best is scored; 0: none."""
        ...

    def start(self, space: Space, rng: Generator) -> Search:
        """A fresh search. The same generator must give the same search: resuming replays it."""
        ...


def check_fitness(fitness: Sequence[float], asked: Sequence[Individual]) -> None:
    """There must be one number, not NaN, for each individual asked for.

    Raises:
        InputError: there is not.
    """
    if len(fitness) != len(asked) or any(map(math.isnan, fitness)):
        raise InputError(
            f"fitness: must be {len(asked)} numbers, not {list(fitness)}; "
            f"give one for each individual asked for"
        )
