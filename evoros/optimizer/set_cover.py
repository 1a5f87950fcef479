"""Set cover by integer programming: sensors that see a sector even after failures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, TypeAlias

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, milp

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, POSITIVE, WHOLE, checked, number_between
from evoros.base.errors import InputError, write_count
from evoros.optimizer import protocol
from evoros.optimizer.ga import GeneticAlgorithm
from evoros.optimizer.history import freeze

ALL_AROUND = 360
# bearings [deg] at which a ``View`` counts sensors
BEARINGS: Array = np.arange(ALL_AROUND, dtype=np.float64) - (ALL_AROUND - 1) / 2
Indices: TypeAlias = NDArray[np.intp]


@dataclass(frozen=True)
@checked
class SetCover(protocol.BundledOptimizer):
    """Covers a sector ahead, and evolves the rest of the design by the genetic algorithm.

    From random candidate places, an integer program selects the cheapest set that still sees every
    bearing of the sector after any ``failed`` sensors fail; among equally cheap sets, it selects
    one with the fewest sensors. Ties are broken at random, ``covers`` times. The genetic algorithm
    then chooses among the resulting sets, called bodies, and evolves all genes that do not belong
    to sensors. See M. S. Daskin, "Network and Discrete Location", Wiley 1995, Chapter 4 (set
    covering, and backup coverage); the solver is HiGHS.
    """

    population_size: Annotated[int, COUNT] = 30
    # width of the sector; None: the widest that sensors can cover
    width_deg: Annotated[float | None, number_between(1.0, ALL_AROUND)] = None
    failed: Annotated[int, replace(WHOLE, limit=3)] = 1  # number of failures that a cover tolerates
    distance_m: Annotated[float, POSITIVE] = 2.0  # distance to be seen, from the robot's middle
    candidates: Annotated[int, replace(COUNT, limit=2000)] = 200  # random candidate places
    covers: Annotated[int, replace(COUNT, limit=1000)] = 8  # number of covers to choose from
    packages = ("scipy",)

    def start(
        self, space: protocol.Space, goals: protocol.Goals, rng: Generator
    ) -> protocol.Search:
        if not isinstance(space, protocol.CoveringSpace):
            raise InputError(
                "optimizer: set_cover needs a space that computes what sensors see (slots, "
                "number, number_gene, view); choose another optimizer"
            )
        bodies = self._draw_bodies(space, rng)
        remaining = _Remaining(space, bodies)
        genetic = GeneticAlgorithm(self.population_size)
        return _CoverSearch(remaining, genetic.start(remaining, goals, rng))

    def _draw_bodies(self, space: protocol.CoveringSpace, rng: Generator) -> list[Array]:
        if not space.slots:
            return []
        places = rng.random((self.candidates, len(space.slots[0].genes)))
        program = self._set_up(space, places)
        width = self._find_width(program)
        cheapest = program.solve(width, program.prices)
        if cheapest is None:
            raise InputError(
                f"optimizer.width_deg: no set of at most {space.number[1]} of the "
                f"{self.candidates} candidate places covers a sector of {width:g} deg after the "
                f"failure of any {write_count(self.failed, 'sensor')}; lower optimizer.width_deg "
                "or optimizer.failed, or raise optimizer.candidates"
            )
        limit = float(program.prices[cheapest].sum())
        covers = {self._break_ties(program, width, limit, rng) for _ in range(self.covers)}
        return [_compose(space, places[list(cover)]) for cover in sorted(covers)]

    def _set_up(self, space: protocol.CoveringSpace, candidates: Array) -> "Program":
        per_genome = len(space.slots)
        views = []
        for first in range(0, len(candidates), per_genome):
            batch = candidates[first : first + per_genome]
            slots, fixed = space.view(_fill(space, batch), self.distance_m)
            views += slots[: len(batch)]
        needed: Array = (1 + self.failed - fixed.counts).astype(np.float64)
        counts = np.array([view.counts for view in views], dtype=np.float64).T
        prices = np.array([view.price for view in views])
        places = [view.place for view in views]
        low, high = space.number
        low = min(low, 1) if any(places) else low  # several slots may share a place
        return Program(counts, needed, prices, (low, high), places)

    def _find_width(self, program: "Program") -> float:
        if self.width_deg is not None:
            return self.width_deg
        low, high = 1, ALL_AROUND + 1
        while high - low > 1:
            middle = (low + high) // 2
            feasible = program.solve(middle, np.zeros(self.candidates)) is not None
            low, high = (middle, high) if feasible else (low, middle)
        return low

    def _break_ties(
        self, program: "Program", width: float, limit: float, rng: Generator
    ) -> tuple[int, ...]:
        """Return a random cover with the fewest sensors, at a total price of at most ``limit``."""
        costs = 1.0 + rng.random(self.candidates) / (1 + program.number[1])
        cover = program.solve(width, costs, limit)
        assert cover is not None  # the cheapest cover is a solution
        return tuple(cover.tolist())


@dataclass(frozen=True)
class Program:
    """The integer program that selects candidate places."""

    counts: Array  # (360, n), number of sensors at each candidate that see each bearing
    needed: Array  # (360,), number of sensors that must see each bearing
    prices: Array  # (n,), price of each candidate
    number: tuple[int, int]  # minimum and maximum number of sensors in a cover
    places: Sequence[str] = ()  # one per candidate; a named place can carry only one sensor

    def solve(self, width_deg: float, costs: Array, limit: float = np.inf) -> Indices | None:
        """Return the cheapest cover by ``costs`` within the price ``limit``; None if infeasible."""
        chosen = np.abs(BEARINGS) <= width_deg / 2
        rows = np.unique(np.column_stack((self.counts, self.needed))[chosen], axis=0)
        limits = [
            LinearConstraint(rows[:, :-1], lb=rows[:, -1]),
            LinearConstraint(np.ones((1, len(costs))), *self.number),
            LinearConstraint(self.prices[np.newaxis], ub=limit * (1 + 1e-9)),
        ]
        for place in sorted({*self.places} - {""}):
            there = np.array([other == place for other in self.places], dtype=np.float64)
            limits.append(LinearConstraint(there[np.newaxis], ub=1.0))
        whole = np.ones(len(costs))
        result = milp(costs, integrality=whole, bounds=Bounds(0.0, 1.0), constraints=limits)
        return None if result.x is None else np.flatnonzero(result.x > 0.5)


def _fill(space: protocol.CoveringSpace, places: Array) -> Array:
    """Return a genome with ``places`` (k, genes per slot) in the first slots, 0 elsewhere."""
    genome = np.zeros(space.size)
    for slot, genes in zip(space.slots, places, strict=False):
        genome[list(slot.genes)] = genes
    return genome


def _compose(space: protocol.CoveringSpace, places: Array) -> Array:
    low, high = space.number
    if 0 < len(places) < low:  # remaining slots repeat a place that can carry only one sensor
        places = np.concatenate((places, *[places[-1:]] * (low - len(places))))
    genome = _fill(space, places)
    if space.number_gene is not None:
        genome[space.number_gene] = (len(places) - low + 0.5) / (high - low + 1)
    return genome


@dataclass(frozen=True)
class _Remaining:
    """The remaining search space: the choice of a body, and all genes outside sensors."""

    space: protocol.CoveringSpace
    bodies: Sequence[Array]

    @cached_property
    def _others(self) -> list[int]:  # genes of the whole space that the cover leaves free
        taken = {gene for slot in self.space.slots for gene in slot.genes}
        return [i for i in range(self.space.size) if i not in taken | {self.space.number_gene}]

    @cached_property
    def _index(self) -> dict[int, int]:
        return {gene: place for place, gene in enumerate(self._others, bool(self.bodies))}

    @property
    def size(self) -> int:
        return len(self._others) + bool(self.bodies)

    @cached_property
    def blocks(self) -> tuple[protocol.Block, ...]:
        body = protocol.Block("body", (protocol.Aspect("body", (), (0,)),))
        kept = [block for block in self.space.blocks if set(block.genes) <= self._index.keys()]
        moved = (block.move(self._index.__getitem__) for block in kept)
        return (*((body,) if self.bodies else ()), *moved)

    @cached_property
    def levels(self) -> Mapping[int, int]:
        levels = self.space.levels
        others = {self._index[gene]: n for gene, n in levels.items() if gene in self._index}
        return {0: len(self.bodies), **others} if len(self.bodies) > 1 else others

    def same(self, first: Array, second: Array, /) -> bool:
        return self.space.same(self.complete(first), self.complete(second))

    def complete(self, genome: Array) -> Array:
        if not self.bodies:
            return genome
        index = min(int(genome[0] * len(self.bodies)), len(self.bodies) - 1)
        whole = self.bodies[index].copy()
        whole[self._others] = genome[1:]
        return whole


@dataclass(frozen=True)
class _CoverSearch:
    remaining: _Remaining
    search: protocol.Search

    def ask(self) -> list[protocol.Individual]:
        return list(map(self._complete, self.search.ask()))

    def tell(self, scores: Mapping[int, protocol.Score]) -> list[protocol.Candidate]:
        rows = self.search.tell(scores)
        return [replace(row, individual=self._complete(row.individual)) for row in rows]

    def champions(self) -> list[protocol.Individual]:
        return list(map(self._complete, self.search.champions()))

    def _complete(self, individual: protocol.Individual) -> protocol.Individual:
        return replace(individual, genome=freeze(self.remaining.complete(individual.genome)))
