"""Allocations: what all keep, and what each does."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from bundled_parts import every
from hypothesis import given
from hypothesis import strategies as st

from evoros.allocation.halving import SequentialHalving
from evoros.allocation.lifelong import Lifelong
from evoros.allocation.once import Once
from evoros.allocation.protocol import Allocation, cap_fitness
from evoros.allocation.racing import Racing
from evoros.allocation.successive_rejects import SuccessiveRejects
from evoros.base.errors import InputError
from evoros.evolution.contest import Contest
from evoros.testing import AllocationSuite
from evoros.testing.allocation import draw_noisy, hold_contest


class TestBundledAllocations(AllocationSuite):
    choose = every("allocation", bad_values={"racing": [{"level": 0.5}, {"first": 9}, {"best": 0}]})


def test_once_never_scores_a_survivor_again() -> None:
    assert set(hold_contest(Once(), 2, {0: [9.0], 1: []}, draw_noisy(0)).scores) == {1}


def test_a_lifelong_fitness_is_the_mean_over_all_trials() -> None:
    earlier = {0: [4.0, 6.0], 1: [9.0], 2: [1.0], 3: []}
    contest = hold_contest(Lifelong(survivors=2, again=3), 2, earlier, lambda i, k: 10.0 * i + k)
    assert contest.scores == {0: [0.0, 1.0, 2.0], 1: [10.0, 11.0, 12.0], 3: [30.0, 31.0]}
    assert contest.fitness() == {0: 13.0 / 5, 1: 42.0 / 4, 3: 30.5}


def test_a_race_without_noise_ends_at_once() -> None:
    contest = hold_contest(Racing(best=1), 1, {i: [] for i in range(8)}, lambda i, _: -float(i))
    assert {i: len(scores) for i, scores in contest.scores.items()} == dict.fromkeys(range(8), 2)


def test_equal_designs_race_to_the_end() -> None:
    contest = hold_contest(
        Racing(max_trials=5), 1, {i: [] for i in range(6)}, lambda i, k: float(k)
    )
    assert all(len(scores) == 5 for scores in contest.scores.values())


def test_common_random_numbers_decide_a_race_earlier() -> None:
    """Conditions that all designs meet alike do not count in a paired test."""

    def trials(shared: bool) -> int:
        rng = np.random.default_rng(1)
        luck = rng.normal(size=(20, 64)) * 3.0

        def draw(i: int, k: int) -> float:
            return float(luck[0 if shared else i, k]) - 0.3 * i + 0.01 * (i * k % 3)

        contest = hold_contest(Racing(max_trials=30, best=1), 1, {i: [] for i in range(12)}, draw)
        return sum(map(len, contest.scores.values()))

    assert trials(shared=True) < trials(shared=False) / 2


@pytest.mark.parametrize(("designs", "budget"), [(8, 6), (30, 5), (5, 9), (2, 4)])
def test_halving_spends_its_budget_equally_on_its_rounds(designs: int, budget: int) -> None:
    allocation = SequentialHalving(budget=budget, max_trials=1000)
    contest = hold_contest(allocation, 1, {i: [] for i in range(designs)}, draw_noisy(3))
    sizes = [len(round_) for round_ in contest.rounds]
    assert sizes[0] == designs
    assert all(after == (before + 1) // 2 for before, after in zip(sizes, sizes[1:]))  # noqa: B905, RUF007
    spent = [sum(round_.values()) for round_ in contest.rounds]
    assert sum(spent) <= budget * designs
    share = budget * designs / len(sizes)
    assert all(share - size < total <= share for total, size in zip(spent, sizes, strict=True))


@pytest.mark.parametrize(("designs", "budget"), [(8, 6), (30, 5), (3, 9)])
def test_successive_rejects_keep_to_their_budget(designs: int, budget: int) -> None:
    allocation = SuccessiveRejects(budget=budget, max_trials=10**6)
    contest = hold_contest(allocation, 1, {i: [] for i in range(designs)}, draw_noisy(4))
    assert sum(map(len, contest.scores.values())) <= budget * designs
    lengths = sorted(map(len, contest.scores.values()))
    assert lengths[-1] == lengths[-2]  # the last two are compared on equal terms


@pytest.mark.parametrize("kind", [SequentialHalving, SuccessiveRejects])
def test_fixed_budgets_find_the_best_more_often_than_equal_trials(
    kind: Callable[..., Allocation],
) -> None:
    designs, budget, wins = 16, 6, {"equal": 0, "allocated": 0}
    for seed in range(200):
        draw = draw_noisy(seed, spread=2.5)
        means = [np.mean([draw(i, k) for k in range(budget)]) for i in range(designs)]
        wins["equal"] += int(np.argmax(means)) == 0
        allocation = kind(budget=budget, max_trials=1000)
        fitness = hold_contest(allocation, 1, {i: [] for i in range(designs)}, draw).fitness()
        wins["allocated"] += max(fitness, key=fitness.__getitem__) == 0
    assert wins["allocated"] > wins["equal"]


@given(st.lists(st.floats(-9, 9), min_size=1, max_size=9), st.data())
def test_who_left_early_never_ranks_above_who_stayed(
    values: list[float], data: st.DataObject
) -> None:
    fitness, rounds = dict(enumerate(values)), [list(range(len(values)))]
    while len(rounds[-1]) > 1 and data.draw(st.booleans()):
        size = data.draw(st.integers(1, len(rounds[-1])))
        rounds.append(rounds[-1][:size])
    capped = cap_fitness(fitness, rounds)
    for before, after in zip(rounds, rounds[1:]):  # noqa: B905, RUF007
        left = set(before) - set(after)
        assert all(capped[i] <= min(capped[j] for j in after) for i in left)
    assert all(capped[i] <= fitness[i] for i in fitness)
    assert all(capped[i] == fitness[i] for i in rounds[-1])


class Greedy(Once):
    """Asks for more than it says."""

    def next_round(self, standings: object, trials: int) -> Mapping[int, int]:
        return {0: 5}


class Idle(Once):
    """Asks for nothing."""

    def next_round(self, standings: object, trials: int) -> Mapping[int, int]:
        return {}


@pytest.mark.parametrize(
    ("allocation", "said"), [(Greedy(), "at most 1"), (Idle(), "gave none to design .")]
)
def test_an_allocation_that_breaks_its_promise_is_refused(allocation: Once, said: str) -> None:
    with pytest.raises(InputError, match=rf"allocation: .*{said}.*; correct (Greedy|Idle)$"):
        Contest(allocation, 1, {0: []}).next_round()
