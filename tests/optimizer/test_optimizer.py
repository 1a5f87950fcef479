import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from bundled_parts import ByName, configured, every, find_other_defaults, kinds
from fixture_types import Patch
from hypothesis import given, settings
from hypothesis import strategies as st
from proposal_sites import is_of

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.optimizer.cma_es import Strategies
from evoros.optimizer.ga import GeneticAlgorithm
from evoros.optimizer.protocol import (
    AskedSearch,
    Candidate,
    Goals,
    Individual,
    Optimizer,
    Score,
    Space,
)
from evoros.optimizer.random_search import RandomSearch
from evoros.optimizer.sobol import Sobol
from evoros.testing import OptimizerSuite
from evoros.testing.optimizer import (
    GOALS,
    THREE_SENSORS,
    Fitness,
    OneGene,
    SensorSpace,
    rate,
    sphere,
    step,
)


@dataclass(frozen=True)
class Steps(SensorSpace):
    """Few designs: each gene has two values, and the last sensor is absent."""

    def same(self, one: Array, other: Array) -> bool:
        return np.array_equal(one[:-4] < 0.5, other[:-4] < 0.5)


Generation = tuple[list[Individual], list[Candidate]]


def run(optimizer: Optimizer, space: Space, seed: int, fitness: Fitness) -> list[Generation]:
    search = optimizer.start(space, GOALS, np.random.default_rng(seed))
    return [step(search, fitness) for _ in range(optimizer.generations)]


def changed(optimizer: Optimizer, **values: Any) -> Optimizer:
    return cast(Optimizer, replace(cast(Any, optimizer), **values))


def noise(seed: int) -> Fitness:
    rng = np.random.default_rng(seed)
    return lambda _: float(rng.random())


def flat(_: Individual) -> float:
    return 0.0


SETTINGS_OF_BOTH: list[dict[str, Any]] = [
    {"population_size": 0}, {"population_size": 2.5}, {"generations": 0}, {"validation_trials": -1}
]  # fmt: skip
BAD: dict[str, list[dict[str, Any]]] = {
    "random_search": SETTINGS_OF_BOTH,
    "ga": [
        *SETTINGS_OF_BOTH, {"mutation_probability": 1.1}, {"crossover_probability": -0.1},
        {"crossover_probability": True}, {"tournament_size": 0}, {"mutation_step": 0},
        {"mutation_step": 1.5}, {"elite": "best"},
    ],
}  # fmt: skip
SETTINGS = st.builds(
    GeneticAlgorithm,
    population_size=st.integers(1, 9),
    generations=st.integers(1, 6),
    mutation_probability=st.sampled_from([0.0, 0.15, 1.0]),
    crossover_probability=st.sampled_from([0.0, 0.25, 1.0]),
    tournament_size=st.integers(1, 4),
    mutation_step=st.sampled_from([1.0, 0.2]),
    elite=st.sampled_from(["best_so_far", "best_child"]),
)
CONFIGURED: ByName[Optimizer] = ByName(
    kinds("optimizer"), lambda name: configured("optimizer", name)
)
BY_LIBRARY = sorted(set(CONFIGURED) - {"ga", "random_search", "set_cover"})
MODULES = {
    "cma_es": "cmaes",
    "cat_cma": "cmaes",
    "cma_mae": "ribs.emitters",
    "map_elites": "ribs.emitters",
    "nsga2": "pymoo.algorithms.moo.nsga2",
    "tpe": "optuna",
}


# Every optimizer of the configuration


def test_configurations_repeat_the_defaults() -> None:
    assert find_other_defaults("optimizer") == []


class TestBundledOptimizers(OptimizerSuite):
    # Each design that the estimator proposes takes 10 ms, and the covers grow with the positions.
    few = ("optimizer.population_size=6", "optimizer.random_first=6")
    small = ("optimizer.candidates=30", "optimizer.covers=2")
    choose = every("optimizer", bad_values=BAD, overrides={"tpe": few, "set_cover": small})


@dataclass
class Converged:
    """A strategy of one proposal that always stops."""

    place: float

    def ask(self) -> Array:
        return np.array([self.place])

    def tell(self, solutions: object) -> None:
        pass

    def should_stop(self) -> bool:
        return True


@pytest.mark.parametrize(("converging", "expected"), [(True, [0, 1, 2]), (False, [0, 0, 0])])
def test_a_strategy_that_has_converged_is_replaced(converging: bool, expected: list[float]) -> None:
    strategies = Strategies("any", 1, map(Converged, range(9)), np.asarray, converging)
    proposed = []
    for _ in range(3):
        proposed += [float(genome[0]) for genome in strategies.propose()]
        strategies.learn(cast(Any, SimpleNamespace(fitness=[0.0])), False)
    assert proposed == expected


@dataclass
class Listing:
    """A search that asks for individuals with these ids, and returns those with others."""

    ids: list[int]
    best: list[int]

    def ask(self) -> list[Individual]:
        return [Individual(i, np.full(1, 0.5), (), "initial") for i in self.ids]

    def champions(self) -> list[Individual]:
        return [Individual(i, np.full(1, 0.5), (), "initial") for i in self.best]


@given(st.lists(st.integers(0, 3), max_size=3), st.lists(st.integers(0, 3), max_size=2))
def test_a_search_asks_for_distinct_individuals_and_returns_no_others(
    ids: list[int], best: list[int]
) -> None:
    search = AskedSearch(cast(Any, Listing(ids, best)), 1)
    if len(set(ids)) < len(ids):
        with pytest.raises(InputError, match="distinct ids"):
            search.ask()
        return
    search.ask()
    if best and set(best) <= set(ids):
        assert [one.id for one in search.champions()] == best
        return
    with pytest.raises(InputError, match="a non-empty list of individuals from ask"):
        search.champions()


@pytest.mark.parametrize("name", BY_LIBRARY)
def test_an_earlier_individual_with_another_score_is_tabled_as_a_survivor(name: str) -> None:
    search = CONFIGURED[name].start(THREE_SENSORS, GOALS, np.random.default_rng(3))
    step(search, sphere)
    old = search.champions()[0].id
    scores = {one.id: rate(one, sphere(one)) for one in search.ask()}
    scores[old] = Score(9.0, (9.0, 9.0), (0.5, 0.5))
    table = {c.individual.id: c for c in search.tell(scores)}
    assert (table[old].fitness, table[old].operator) == (9.0, "survivor")


@pytest.mark.parametrize("name", CONFIGURED)
def test_a_space_of_one_gene_and_few_individuals_is_searched(name: str) -> None:
    optimizer = changed(CONFIGURED[name], generations=12)
    if name == "cma_mae":
        optimizer = changed(optimizer, population_size=4, strategies=1)
    else:
        optimizer = changed(optimizer, population_size=4)
    history = run(optimizer, OneGene(), 1, sphere)
    assert min(abs(c.individual.genome[0] - 0.5) for _, table in history for c in table) < 0.2


@pytest.mark.parametrize("name", sorted({*BY_LIBRARY} - {"tpe"}))
def test_a_flat_fitness_is_searched(name: str) -> None:
    assert len(run(changed(CONFIGURED[name], generations=20), THREE_SENSORS, 1, flat)) == 20


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({"cat_cma", "cma_es", "cma_mae", "map_elites", "tpe"}))
def test_it_finds_better_designs_than_random_search_at_equal_cost(name: str) -> None:
    optimizer = CONFIGURED[name]
    size = optimizer.population_size  # type: ignore[attr-defined]
    drawn = RandomSearch(population_size=size, generations=12)
    reached, chance = (
        sum(
            max(c.fitness for _, table in run(search, THREE_SENSORS, seed, sphere) for c in table)
            for seed in range(3)
        )
        for search in (changed(optimizer, generations=12), drawn)
    )
    assert reached > chance


@pytest.mark.parametrize(("name", "module"), MODULES.items())
def test_a_library_that_is_not_installed_is_named_with_its_extra(
    name: str, module: str, monkeypatch: Patch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, match=r"pip install 'evoros\[search\]'") as caught:
        CONFIGURED[name].start(THREE_SENSORS, GOALS, np.random.default_rng(0))
    assert "\n" not in str(caught.value)


def test_regions_and_numbers_are_levels_to_cat_cma_and_tpe() -> None:
    for name in ("cat_cma", "tpe"):
        for asked, _ in run(changed(CONFIGURED[name], generations=3), THREE_SENSORS, 1, sphere):
            for one in asked:
                levels = one.genome[::4] * 5
                np.testing.assert_allclose(levels, np.floor(levels) + 0.5, atol=1e-12)


def test_sobol_designs_are_a_prefix_of_one_sequence_that_halves_every_range_evenly() -> None:
    few, many = (
        [
            one
            for asked, _ in run(Sobol(size, generations=256 // size), THREE_SENSORS, 1, flat)
            for one in asked
        ]
        for size in (16, 64)
    )
    assert [one.genome.tobytes() for one in few] == [one.genome.tobytes() for one in many]
    assert np.all(np.sum([one.genome < 0.5 for one in few], axis=0) == 128)


def test_an_archive_has_the_best_design_of_each_cell() -> None:
    for name in ("map_elites", "cma_mae"):
        optimizer = changed(CONFIGURED[name], cells=4, generations=8)
        search = optimizer.start(THREE_SENSORS, GOALS, np.random.default_rng(1))
        best: dict[tuple[int, ...], tuple[float, int]] = {}
        for _ in range(8):
            asked = search.ask()
            scores = {one.id: rate(one, sphere(one)) for one in asked}
            for i, score in scores.items():
                cell = tuple(min(3, int(4 * value)) for value in score.descriptor)
                best[cell] = max(best.get(cell, (-math.inf, 0)), (score.fitness, -i))
            search.tell(scores)
        ranked = sorted(best.values(), reverse=True)
        assert [one.id for one in search.champions()] == [-number for _, number in ranked]


def test_random_search_takes_more_genes_than_a_sobol_sequence(monkeypatch: Patch) -> None:
    monkeypatch.setattr("evoros.optimizer.sobol.MOST_GENES", THREE_SENSORS.size - 1)
    with pytest.raises(InputError) as refused:
        CONFIGURED["sobol"].start(THREE_SENSORS, Goals(), np.random.default_rng(0))
    assert is_of(str(refused.value), "evoros/optimizer/sobol.py optimizer=sobol")
    CONFIGURED["random_search"].start(THREE_SENSORS, Goals(), np.random.default_rng(0))


def test_no_champion_of_nsga2_is_dominated() -> None:
    search = CONFIGURED["nsga2"].start(THREE_SENSORS, GOALS, np.random.default_rng(1))
    told: dict[int, tuple[float, ...]] = {}
    for _ in range(10):
        scores = {one.id: rate(one, sphere(one)) for one in search.ask()}
        told |= {i: score.objectives for i, score in scores.items()}
        search.tell(scores)
    front = [told[one.id] for one in search.champions()]
    assert len(front) > 3
    for point in front:
        for other in told.values():
            assert other == point or not all(a >= b for a, b in zip(other, point, strict=True))


@pytest.mark.parametrize("name", ["map_elites", "cma_mae", "nsga2"])
def test_goals_that_a_search_needs_are_asked_for(name: str) -> None:
    with pytest.raises(InputError, match=r"(descriptors|objectives): .*\+measure@") as caught:
        CONFIGURED[name].start(THREE_SENSORS, Goals(), np.random.default_rng(0))
    assert "\n" not in str(caught.value)


# The genetic algorithm


@settings(max_examples=80)
@given(SETTINGS, st.integers(0, 2**32), st.lists(st.floats(-1e9, 1e9), min_size=1))
def test_the_best_so_far_is_never_lost(
    optimizer: GeneticAlgorithm, seed: int, values: list[float]
) -> None:
    history = run(optimizer, THREE_SENSORS, seed, lambda one: values[one.id % len(values)])
    best = -math.inf
    for asked, table in history:
        best = max([best, *(values[one.id % len(values)] for one in asked)])
        if optimizer.elite == "best_so_far":
            assert max(c.fitness for c in table) == best
            assert any(c.survived for c in table if c.fitness == best)


@settings(max_examples=80)
@given(SETTINGS, st.integers(0, 2**32))
def test_each_table_is_the_pool_and_the_next_population_comes_from_it(
    optimizer: GeneticAlgorithm, seed: int
) -> None:
    size = optimizer.population_size
    survivors: list[int] = []
    for generation, (_, table) in enumerate(run(optimizer, THREE_SENSORS, seed, noise(seed))):
        assert len(table) == (size if generation == 0 else 2 * size)
        assert sum(c.survived for c in table) == size
        # Half of the pool was the population; some of it has mutated since, never its first.
        ids = [c.individual.id for c in table[:size]]
        if generation > 0:
            origin = [
                c.individual.parents[0] if c.operator == "mutation" else c.individual.id
                for c in table[:size]
            ]
            assert sorted(origin) == sorted(survivors)
            assert table[0].operator == "survivor"
        else:
            assert ids == list(range(size))
        survivors = [c.individual.id for c in table for _ in range(c.survived)]


@settings(max_examples=80)
@given(SETTINGS, st.integers(0, 2**32), st.sampled_from([SensorSpace(3), Steps(2), Steps(4)]))
def test_what_is_evaluated_is_a_new_design_and_clones_are_not(
    optimizer: GeneticAlgorithm, seed: int, space: SensorSpace
) -> None:
    known: dict[int, Individual] = {}
    fitness: dict[int, float] = {}
    for asked, table in run(optimizer, space, seed, noise(seed)):
        for one in asked:
            assert one.operator in {"initial", "crossover", "mutation", "crossover+mutation"}
            for parent in one.parents:
                assert not space.same(known[parent].genome, one.genome)
        known |= {one.id: one for one in asked}
        for c in table:
            assert known[c.individual.id] is c.individual
            assert fitness.setdefault(c.individual.id, c.fitness) == c.fitness
            if c.operator in ("survivor", "clone"):
                assert c.individual not in asked
            else:
                assert c.operator == c.individual.operator
                assert c.individual in asked


@settings(max_examples=50)
@given(SETTINGS, st.integers(0, 2**32), st.integers(1, 5))
def test_children_are_made_of_one_parents_head_and_the_others_tail(
    optimizer: GeneticAlgorithm, seed: int, count: int
) -> None:
    space = SensorSpace(count)
    known: dict[int, Individual] = {}
    for asked, _ in run(optimizer, space, seed, noise(seed)):
        for one in asked:
            if one.operator == "crossover":
                head, tail = (known[parent].genome for parent in one.parents)
                cuts = [
                    np.concatenate([head[: 4 * cut], tail[4 * cut :]]) for cut in range(1, count)
                ]
                assert any(np.array_equal(one.genome, cut) for cut in cuts)
        known |= {one.id: one for one in asked}


def test_a_mutation_changes_whole_aspects_of_some_sensors() -> None:
    optimizer = GeneticAlgorithm(crossover_probability=0, mutation_probability=1, generations=40)
    known: dict[int, Individual] = {}
    places = angles = both = sensors = mutants = 0
    for asked, table in run(optimizer, THREE_SENSORS, 11, noise(2)):
        assert len(asked) >= len(table) - 1 or known == {}  # all but the elite
        for one in asked:
            if one.operator == "mutation":
                changed = (known[one.parents[0]].genome != one.genome).reshape(3, 4)
                place, angle = changed[:, :3].all(axis=1), changed[:, 3]
                assert np.array_equal(place, changed[:, :3].any(axis=1))
                mutants += 1
                sensors += int(np.sum(place | angle))
                places += int(np.sum(place & ~angle))
                angles += int(np.sum(angle & ~place))
                both += int(np.sum(place & angle))
        known |= {one.id: one for one in asked}
    # place, angle or both: a third each. Each sensor with probability 1/3 given that one changes.
    for share in (places, angles, both):
        assert abs(share - sensors / 3) < 4 * math.sqrt(sensors * 2 / 9)
    assert abs(sensors / mutants - 1 / (1 - (2 / 3) ** 3)) < 0.1


def test_a_narrow_step_stays_near_and_redraws_few_regions() -> None:
    step = 0.1
    optimizer = GeneticAlgorithm(
        crossover_probability=0, mutation_probability=1, mutation_step=step, generations=40
    )
    known: dict[int, Individual] = {}
    placed = regions = 0
    for asked, _ in run(optimizer, THREE_SENSORS, 1, noise(4)):
        for one in asked:
            if one.parents:
                before = known[one.parents[0]].genome.reshape(3, 4)
                after = one.genome.reshape(3, 4)
                assert np.all(np.abs(after - before)[:, 1:] <= step / 2 + 1e-12)
                placed += int(np.sum(after[:, 1] != before[:, 1]))
                regions += int(np.sum(after[:, 0] != before[:, 0]))
        known |= {one.id: one for one in asked}
    assert abs(regions - step * placed) < 4 * math.sqrt(placed * step * (1 - step))


@pytest.mark.slow
def test_the_rates_of_crossover_and_mutation_are_those_configured() -> None:
    """At first all parents differ in every gene, so that a pair that crosses makes two children."""
    pairs = crossed = candidates = mutated = 0
    for seed in range(200):
        optimizer = GeneticAlgorithm(generations=2)
        _, (_, table) = run(optimizer, SensorSpace(20), seed, flat)
        candidates += len(table) - 1
        mutated += sum("mutation" in c.operator for c in table)
    assert abs(mutated - 0.15 * candidates) < 4 * math.sqrt(candidates * 0.15 * 0.85)
    for seed in range(200):
        optimizer = GeneticAlgorithm(generations=2, mutation_probability=0)
        _, (_, table) = run(optimizer, SensorSpace(2), seed, flat)
        children = table[30:]
        for first, second in zip(children[0::2], children[1::2], strict=True):
            if first.individual.id != second.individual.id:  # a pair of one cannot cross over
                pairs += 1
                crossed += first.operator == "crossover"
                assert first.operator == second.operator
                if first.operator == "crossover":
                    assert first.individual.parents == second.individual.parents[::-1]
    assert abs(crossed - 0.25 * pairs) < 4 * math.sqrt(pairs * 0.25 * 0.75)


@pytest.mark.slow
def test_evaluations_are_the_changed_individuals_only() -> None:
    """30 + 24 (59 x 0.15 mutants + 30 x 0.25 x 0.85 children), less the children that are copies.

    At most 397 on average, reached while the population is diverse; at least the mutants' 242.
    """
    mutants = 24 * 59 * 0.15
    children = 24 * 30 * 0.25 * 0.85

    def mean(fitness: Callable[[int], Fitness]) -> float:
        histories = [
            run(GeneticAlgorithm(), THREE_SENSORS, seed, fitness(seed)) for seed in range(20)
        ]
        return sum(len(asked) for history in histories for asked, _ in history) / len(histories)

    deviation = math.sqrt(24 * 59 * 0.15 * 0.85 + 4 * 24 * 15 * 0.25 * 0.75)
    for fitness in (noise, lambda _: flat):
        assert 30 + mutants < mean(fitness) + 4 * deviation / math.sqrt(20)
        assert mean(fitness) - 4 * deviation / math.sqrt(20) < 30 + mutants + children
    assert mean(noise) < mean(lambda _: flat)  # selection makes copies, copies cost nothing


def test_the_best_child_may_be_worse_than_the_best_so_far() -> None:
    falling: Fitness = lambda one: -float(one.id)  # noqa: E731 - the oldest is the best
    optimizer = GeneticAlgorithm(
        population_size=1, mutation_probability=1, elite="best_child", generations=5
    )
    history = run(optimizer, THREE_SENSORS, 0, falling)
    assert [[c.individual.id for c in table if c.survived] for _, table in history] == [
        [0], [1], [2], [3], [4],
    ]  # fmt: skip
    kept = GeneticAlgorithm(population_size=1, mutation_probability=1, generations=5)
    for _, table in run(kept, THREE_SENSORS, 0, falling):
        assert [c.individual.id for c in table if c.survived] == [0]


def test_without_operators_nothing_more_is_evaluated() -> None:
    optimizer = GeneticAlgorithm(mutation_probability=0, crossover_probability=0)
    history = run(optimizer, THREE_SENSORS, 0, noise(0))
    assert [len(asked) for asked, _ in history] == [30] + [0] * 24
    copies = [max(c.survived for c in table) for _, table in history]
    assert len({c.individual.id for c in history[-1][1]}) == 1, copies  # one has taken over


@pytest.mark.slow
def test_tournaments_prefer_the_better_as_much_as_they_should() -> None:
    """The better half fills 1 - (1/2)^k of the places that a tournament of k fills."""
    for size in (1, 2, 5):
        better = places = 0
        for seed in range(300):
            optimizer = GeneticAlgorithm(tournament_size=size, generations=1)
            ((_, table),) = run(optimizer, THREE_SENSORS, seed, lambda one: float(one.id < 15))
            better += sum(c.survived for c in table[:15]) - 1  # the elite is not drawn
            places += 29
        share = 1 - 0.5**size
        assert abs(better - share * places) < 4 * math.sqrt(places * share * (1 - share) + 1)


def test_parents_win_tournaments_too() -> None:
    better = expected = variance = 0.0
    optimizer = GeneticAlgorithm(generations=2, mutation_probability=0, crossover_probability=0)
    for seed in range(300):
        _, (_, table) = run(optimizer, THREE_SENSORS, seed, lambda one: float(one.id < 15))
        share = 1 - (1 - sum(c.individual.id < 15 for c in table[:30]) / 30) ** 2
        better += sum(c.individual.id < 15 for c in table[30:])
        expected += 30 * share
        variance += 30 * share * (1 - share)
    assert abs(better - expected) < 4 * math.sqrt(variance)


def test_it_beats_random_search_at_equal_cost() -> None:
    def best(optimizer: Optimizer, seed: int) -> tuple[float, int]:
        history = run(optimizer, THREE_SENSORS, seed, sphere)
        cost = sum(len(asked) for asked, _ in history)
        return max(c.fitness for _, table in history for c in table), cost

    wins = 0
    for seed in range(10):
        evolved, cost = best(GeneticAlgorithm(), seed)
        drawn, budget = best(RandomSearch(population_size=16), seed)
        assert cost <= budget
        wins += evolved > drawn
    assert wins >= 9


def test_individuals_cannot_be_changed_after_they_are_made() -> None:
    for asked, _ in run(
        GeneticAlgorithm(generations=4, mutation_probability=1), THREE_SENSORS, 0, flat
    ):
        for one in asked:
            with pytest.raises(ValueError, match="read-only"):
                one.genome[0] = 0.5


def test_a_space_without_genes_is_refused() -> None:
    with pytest.raises(InputError, match="nothing to evolve"):
        GeneticAlgorithm().start(SensorSpace(0), GOALS, np.random.default_rng(0))
    asked, _ = run(RandomSearch(population_size=2), SensorSpace(0), 0, flat)[0]
    assert [len(one.genome) for one in asked] == [0, 0]


def test_random_search_keeps_the_best_and_draws_all_else_afresh() -> None:
    best, kept = -math.inf, -1
    for generation, (asked, table) in enumerate(run(RandomSearch(), THREE_SENSORS, 5, noise(5))):
        assert len(asked) == 16
        assert len(table) == 16 + (generation > 0)
        if generation > 0:
            assert (table[0].individual.id, table[0].operator) == (kept, "survivor")
        (winner,) = [c for c in table if c.survived]
        assert winner.survived == 1
        assert winner.fitness == max(c.fitness for c in table) >= best
        best, kept = winner.fitness, winner.individual.id
