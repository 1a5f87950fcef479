"""The genetic algorithm of Evo-ROS (2018), Section 5 ("Evolutionary Parameters") and Table 1."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, FRACTION, PROBABILITY, checked, one_of
from evoros.optimizer.history import freeze
from evoros.optimizer.protocol import (
    Aspect,
    BundledOptimizer,
    Candidate,
    Goals,
    Individual,
    Score,
    Search,
    Space,
    check_scores,
    require_genes,
)


@dataclass(frozen=True)
@checked
class GeneticAlgorithm(BundledOptimizer):
    """A genetic algorithm: tournaments, crossover between blocks, mutation of aspects, one elite.

    In each generation, tournaments in the population fill a parent pool of the same size.
    Consecutive parents are crossed over or cloned. The population and the children form the
    candidate pool, in which each candidate except the elite may mutate. The new designs are
    evaluated. The elite and the winners of tournaments in the candidate pool form the next
    population. With ``best_child``, as in the original study, the elite is the best new design of
    the generation, so that the best design so far can be lost.
    """

    population_size: Annotated[int, COUNT] = 30
    mutation_probability: Annotated[float, PROBABILITY] = 0.15  # per candidate
    crossover_probability: Annotated[float, PROBABILITY] = 0.25  # per pair of parents
    tournament_size: Annotated[int, replace(COUNT, limit=1000)] = 2
    mutation_step: Annotated[float, FRACTION] = 1.0  # interval of redraws, relative to ranges
    elite: Annotated[str, one_of("best_so_far", "best_child")] = "best_so_far"

    def start(self, space: Space, goals: Goals, rng: Generator) -> Search:
        require_genes(space)
        return _GeneticSearch(self, space, rng)


class _GeneticSearch:
    """A started search; the elite is first in the population and in the pool."""

    def __init__(self, settings: GeneticAlgorithm, space: Space, rng: Generator) -> None:
        self._settings, self._space, self._rng = settings, space, rng
        self._fitness: dict[int, float] = {}  # keyed by id
        self._created = 0
        self._pool: list[tuple[Individual, str]] = []  # individuals and their operators
        self._elite: Individual | None = None
        for _ in range(settings.population_size):
            individual = self._create(rng.random(space.size), (), "initial")
            self._pool.append((individual, "initial"))

    def ask(self) -> list[Individual]:
        return [member for member, _ in self._pool if member.id not in self._fitness]

    def tell(self, scores: Mapping[int, Score]) -> list[Candidate]:
        asked = self.ask()
        check_scores(scores, asked)
        self._fitness |= {id_: float(score.fitness) for id_, score in scores.items()}
        self._fitness = {member.id: self._fitness[member.id] for member, _ in self._pool}
        winners = self._select({individual.id for individual in asked})
        self._elite = self._pool[winners[0]][0]
        copies = Counter(winners)
        table = [
            Candidate(member, operator, self._fitness[member.id], copies[place])
            for place, (member, operator) in enumerate(self._pool)
        ]
        self._breed([self._pool[place][0] for place in winners])
        return table

    def champions(self) -> list[Individual]:
        return [] if self._elite is None else [self._elite]

    def _select(self, new: set[int]) -> list[int]:
        members = [member for member, _ in self._pool]
        eligible = list(range(len(members)))
        if self._settings.elite == "best_child":
            eligible = [place for place in eligible if members[place].id in new] or eligible
        elite = max(eligible, key=lambda place: self._fitness[members[place].id])
        others = (self._tournament(members) for _ in range(self._settings.population_size - 1))
        return [elite, *others]

    def _tournament(self, members: list[Individual]) -> int:
        size = self._settings.tournament_size
        drawn: list[int] = self._rng.integers(len(members), size=size).tolist()
        return max(drawn, key=lambda place: self._fitness[members[place].id])

    def _breed(self, population: list[Individual]) -> None:
        parents = [population[self._tournament(population)] for _ in population]
        pool = [(member, "survivor") for member in population]
        for first, second in zip(parents[0::2], parents[1::2], strict=False):
            pool += self._breed_pair(first, second)
        if len(parents) % 2:
            pool.append((parents[-1], "clone"))
        known = {member.id: member for member in population}
        self._pool = pool[:1] + [self._mutate(*candidate, known) for candidate in pool[1:]]

    def _breed_pair(self, first: Individual, second: Individual) -> list[tuple[Individual, str]]:
        blocks = self._space.blocks
        if self._rng.random() >= self._settings.crossover_probability or len(blocks) < 2:
            return [(first, "clone"), (second, "clone")]
        cut = int(self._rng.integers(1, len(blocks)))
        tail = [gene for block in blocks[cut:] for gene in block.genes]
        return [self._cross(first, second, tail), self._cross(second, first, tail)]

    def _cross(
        self, head: Individual, other: Individual, tail: list[int]
    ) -> tuple[Individual, str]:
        genome = head.genome.copy()
        genome[tail] = other.genome[tail]
        for parent in (head, other):
            if self._space.same(genome, parent.genome):
                return parent, "clone"  # an equal design requires no new evaluation
        return self._create(genome, (head.id, other.id), "crossover"), "crossover"

    def _mutate(
        self, individual: Individual, operator: str, population: Mapping[int, Individual]
    ) -> tuple[Individual, str]:
        if self._rng.random() >= self._settings.mutation_probability:
            return individual, operator
        genome = individual.genome.copy()
        blocks = self._space.blocks
        for i in self._draw_some(len(blocks)):
            for j in self._draw_some(len(blocks[i].aspects)):
                self._redraw(genome, blocks[i].aspects[j])
        if self._space.same(genome, individual.genome):
            return individual, operator
        if individual.id in self._fitness:
            return self._create(genome, (individual.id,), "mutation"), "mutation"
        for parent in (population[i] for i in individual.parents):
            if self._space.same(genome, parent.genome):
                return parent, "clone"  # the mutation has undone the crossover
        # A mutated child not yet evaluated remains one individual, with two operators.
        both = f"{individual.operator}+mutation"
        return replace(individual, genome=freeze(genome), operator=both), both

    def _draw_some(self, count: int) -> list[int]:
        """Draw each of ``count`` indices with probability 1/count, until at least one is drawn."""
        while True:
            picked = np.flatnonzero(self._rng.random(count) * count < 1)
            if len(picked):
                return picked.tolist()

    def _redraw(self, genome: Array, aspect: Aspect) -> None:
        step, rng = self._settings.mutation_step, self._rng
        for gene in aspect.categorical:
            if rng.random() < step:
                genome[gene] = rng.random()
        for gene in aspect.continuous:
            if step == 1:
                genome[gene] = rng.random()
            else:
                value = abs(genome[gene] + step * (rng.random() - 0.5))  # reflect at 0
                genome[gene] = min(value, 2 - value)  # reflect at 1

    def _create(self, genome: Array, parents: tuple[int, ...], operator: str) -> Individual:
        self._created += 1
        return Individual(self._created - 1, freeze(genome), parents, operator)
