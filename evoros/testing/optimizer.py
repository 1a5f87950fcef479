"""Conformance tests for optimizers, on small spaces, with scores that depend only on genomes."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.optimizer.protocol import (
    Aspect,
    Block,
    Candidate,
    Goals,
    Individual,
    Optimizer,
    Score,
    Search,
    Space,
    View,
)
from evoros.testing.part import PartSuite, bits


@dataclass(frozen=True)
class SensorSpace:
    """A space like the case study's, with a region, two coordinates and an angle per sensor."""

    count: int = 3

    @property
    def size(self) -> int:
        """The number of genes, four per sensor."""
        return 4 * self.count

    @property
    def blocks(self) -> tuple[Block, ...]:
        """One block per sensor."""
        return tuple(
            Block(f"{i}", (Aspect("place", (i + 1, i + 2), (i,)), Aspect("angle", (i + 3,))))
            for i in range(0, self.size, 4)
        )

    @property
    def levels(self) -> Mapping[int, int]:
        """Five regions per sensor."""
        return dict.fromkeys(range(0, self.size, 4), 5)

    @property
    def slots(self) -> tuple[Block, ...]:
        """All blocks."""
        return self.blocks

    @property
    def number(self) -> tuple[int, int]:
        """The number of sensors, which is constant."""
        return self.count, self.count

    number_gene = None  # the number of sensors does not evolve

    def view(self, genome: Array, distance_m: float) -> tuple[list[View], View]:
        """Return views in which each sensor sees 60 deg around its heading, at any distance."""
        bearings = np.arange(360) - 179.5
        headings = 180.0 * (genome[3::4] - 0.5)
        seen = np.abs(bearings - headings[:, np.newaxis]) <= 30.0
        return [View(row.astype(np.int64), 1.0) for row in seen], View(np.zeros(360, np.int64), 0.0)

    def same(self, one: Array, other: Array) -> bool:
        """Return True if all genes are equal."""
        return np.array_equal(one, other)


class OneGene(SensorSpace):
    """A space with one continuous gene and no sensors."""

    size = 1
    blocks = (Block("value", (Aspect("value", (0,)),)),)
    slots = ()
    levels = MappingProxyType[int, int]({})


THREE_SENSORS = SensorSpace(3)
GOALS = Goals(("first", "second"), {"one": (0.0, 1.0), "two": (0.0, 1.0)})


def sphere(individual: Individual) -> float:
    """Return a fitness with maximum 0 at the centre of the cube."""
    return -float(np.sum((individual.genome - 0.5) ** 2))


def rate(individual: Individual, fitness: float) -> Score:
    """Return a score with objectives and descriptors that depend on the genome."""
    genome = individual.genome
    ends = (float(genome[0]), float(genome[-1])) if len(genome) else (0.0, 0.0)
    return Score(fitness, (fitness, ends[0]), ends)


GENERATIONS = 4
BAD_SCORES = Score(math.nan), Score(0.0, (math.nan,)), Score(0.0, (), (math.nan,)), None

Fitness = Callable[[Individual], float]


class OptimizerSuite(PartSuite):
    """Conformance tests for an optimizer, with three sensors, objectives and descriptors."""

    part: Optimizer
    protocol = Optimizer

    def start(self, space: Space = THREE_SENSORS, seed: int = 3) -> Search:
        """Start a search."""
        return self.part.start(space, GOALS, generator(str(seed), "optimizer"))

    def use(self, part: Optimizer, seed: int) -> Iterator[object]:
        """Search for several generations with random scores; yield tables and champions."""
        search = part.start(THREE_SENSORS, GOALS, generator(str(seed), "optimizer"))
        luck = np.random.default_rng(seed)
        for _ in range(GENERATIONS):
            asked = search.ask()
            scores = {one.id: rate(one, float(luck.random())) for one in asked}
            table = list_rows(search.tell(self.lend(scores)))
            yield table, [champion.id for champion in search.champions()]

    def test_another_generator_gives_another_search(self) -> None:
        """The search depends on its random generator, unless it is an enumeration."""
        genomes = [bits([one.genome for one in self.start(seed=seed).ask()]) for seed in (3, 4)]
        assert genomes[0] != genomes[1], "the first generation must depend on the random generator"

    def test_the_order_of_scores_does_not_matter(self) -> None:
        """``tell`` identifies individuals by id, in any order."""
        records = []
        for reverse in (False, True):
            search, tables = self.start(), []
            for _ in range(4):
                scores = {one.id: rate(one, sphere(one)) for one in search.ask()}
                ordered = {i: scores[i] for i in sorted(scores, reverse=reverse)}
                tables.append(bits(list_rows(search.tell(ordered))))
            records.append((tables, [champion.id for champion in search.champions()]))
        assert records[0] == records[1]

    def test_it_asks_for_new_genomes_of_the_cube_and_tables_them(self) -> None:
        """Ids are new, genes are from 0 to 1, and parents were evaluated earlier."""
        search, seen = self.start(), set[int]()
        for _ in range(GENERATIONS):
            asked, table = step(search, sphere)
            for one in asked:
                genome, parents = one.genome, one.parents
                assert one.id not in seen, f"individual {one.id} must be proposed only once"
                assert genome.shape == (THREE_SENSORS.size,), (
                    f"{genome} must have one value per gene"
                )
                assert np.all((genome >= 0) & (genome <= 1)), f"genes must be from 0 to 1: {genome}"
                assert set(parents) <= seen, f"the parents {parents} must be known individuals"
            asked_ids, tabled = {one.id for one in asked}, {row.individual.id for row in table}
            seen |= asked_ids
            assert asked_ids <= tabled, "the table must have a row for each new individual"
            assert tabled <= seen, "the table must have no row for an unknown individual"

    def test_a_space_of_one_gene_is_searched(self) -> None:
        """A space of one gene can be searched."""
        search = self.start(OneGene())
        for _ in range(GENERATIONS):
            step(search, sphere)

    def test_equal_scores_are_no_error(self) -> None:
        """Equal scores of all designs are accepted; many runs start this way."""
        search = self.start()
        for _ in range(GENERATIONS):
            step(search, lambda _: 0.0)

    def test_bad_scores_are_refused_and_change_nothing(self) -> None:
        """A missing or NaN score raises an InputError, after which ``tell`` can be repeated."""
        for bad in BAD_SCORES:
            search = self.start()
            asked = search.ask()
            good = {one.id: rate(one, 0.0) for one in asked}
            wrong = {i: score for i, score in good.items() if i != asked[-1].id}
            refusal, name = "", bad or "a missing score"
            try:
                search.tell(wrong if bad is None else {**wrong, asked[-1].id: bad})
            except InputError as error:
                refusal = str(error)
            assert "scores" in refusal, f"the error for {name} must name scores, not {refusal!r}"
            assert [one.id for one in search.ask()] == [one.id for one in asked]
            search.tell(good)

    def test_the_first_champion_is_the_best_so_far(self) -> None:
        """The best individual comes first, and there is no champion before the first scores."""
        search = self.start()
        assert not search.champions(), "there must be no champion before the first scores"
        best: Individual | None = None
        for _ in range(4):
            asked, _ = step(search, sphere)
            best = max([*asked, *([best] if best else [])], key=sphere)
            first = search.champions()[0]
            assert sphere(first) == sphere(best), "the best individual must come first"

    def test_a_changed_score_counts(self) -> None:
        """An earlier individual can have a new fitness, even one above all others."""
        search = self.start()
        step(search, sphere)
        known = search.champions()[0].id
        for generation in range(3):
            scores = {one.id: rate(one, sphere(one)) for one in search.ask()}
            if generation == 0:
                scores[known] = Score(9.0, (9.0, 9.0), (0.5, 0.5))
            table = {row.individual.id: row.fitness for row in search.tell(scores)}
            assert table.get(known, 9.0) == 9.0, "the table must show the new fitness"
            assert search.champions()[0].id == known, "the new score must count"


def step(search: Search, fitness: Fitness) -> tuple[list[Individual], list[Candidate]]:
    """Ask, evaluate and tell once; return the individuals and the table."""
    asked = list(search.ask())
    scores: Mapping[int, Score] = {one.id: rate(one, fitness(one)) for one in asked}
    return asked, list(search.tell(scores))


def list_rows(table: Sequence[Candidate]) -> list[object]:
    """Return the rows of a table as plain values."""
    told = ((row.individual, (row.operator, row.fitness, row.survived)) for row in table)
    return [(one.id, one.genome, one.parents, *rest) for one, rest in told]
