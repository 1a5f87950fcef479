"""The score of the BARN challenge, and the study of README.md: budgets, intervals and tables."""

from dataclasses import replace

import barn
import barn_tables
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.mission.mission import COLLISION, COMPLETED, LOST, TIME_LIMIT, Outcome
from evoros.plugins.barn.fitness import Barn, share_way
from evoros.testing.subjects import example_world

SHORTEST_M = 10.0  # so that the optimal time is 5 s
SECONDS = st.floats(0.1, 100.0)


def mission(ended: str, time_s: float = 20.0, goal_m: float = 0.5) -> Outcome:
    nothing = Outcome.failure(ended, "", 100.0, 2, price=8.0, shortest_m=SHORTEST_M)
    done = ended == COMPLETED
    distances = (goal_m, 0.0)
    return replace(nothing, completed=done, time_s=time_s, least_waypoint_distances_m=distances)


@pytest.mark.parametrize(
    ("time_s", "score"),
    [(1.0, 0.5), (10.0, 0.5), (12.5, 0.4), (20.0, 0.25), (40.0, 0.125), (99.0, 0.125)],
)
def test_the_score_is_the_formula(time_s: float, score: float) -> None:
    assert Barn().score([mission(COMPLETED, time_s)]) == pytest.approx(score)


@given(SECONDS, SECONDS)
def test_a_faster_success_is_never_worse(one: float, other: float) -> None:
    slow, fast = (Barn().score([mission(COMPLETED, t)]) for t in sorted((one, other))[::-1])
    assert 0.125 <= slow <= fast <= 0.5


@given(SECONDS, st.sampled_from([COLLISION, TIME_LIMIT]))
def test_without_success_the_score_is_0(time_s: float, ended: str) -> None:
    assert Barn().score([mission(ended, time_s)]) == 0.0
    assert Barn().score([mission(COMPLETED, 10.0), mission(ended, time_s)]) == 0.25


@given(st.floats(0.0, 30.0), st.floats(0.0, 2.0))
def test_the_way_counts_by_its_weight(goal_m: float, weight: float) -> None:
    fitness = Barn(way_weight=weight)
    failed = mission(COLLISION, goal_m=goal_m)
    assert share_way(failed) == pytest.approx(max(1.0 - goal_m / SHORTEST_M, 0.0))
    assert fitness.score([failed]) == pytest.approx(weight * share_way(failed))
    assert fitness.score([mission(COMPLETED, 10.0)]) == pytest.approx(0.5 + weight)
    low, high = fitness.bounds(3)
    assert low <= fitness.score([failed]) <= high + 1e-12


def test_a_mission_that_was_not_run_scores_nothing() -> None:
    lost = Outcome.failure(LOST, "why", 100.0, 2, shortest_m=float("nan"))
    assert Barn(way_weight=0.2).worst([lost]) == 0.0


def test_worlds_without_a_shortest_way_are_refused_before_a_run() -> None:
    with pytest.raises(InputError, match=r"world\.boxes: the world must have shortest_m"):
        Barn().check_worlds({"boxes": example_world()})
    Barn().check_worlds({"boxes": replace(example_world(), shortest_m=10.0)})


scores = arrays(np.float64, 5, elements=st.floats(0, 0.5), unique=True)
prices = st.lists(st.integers(1, 700), min_size=1, max_size=6, unique=True)


@given(st.lists(prices, min_size=1, max_size=5), st.integers(0, 800))
def test_a_budget_buys_the_dearest_design_of_each_front(
    fronts: list[list[int]], budget: int
) -> None:
    frames = [pd.DataFrame({"price": sorted([0, *front])}) for front in fronts]
    chosen = barn_tables.choose(frames, float(budget))
    assert list(chosen["price"]) == [
        max(price for price in [0, *front] if price <= budget) for front in fronts
    ]


@settings(deadline=None)
@given(scores, scores)
def test_a_comparison_is_antisymmetric(one: Array, other: Array) -> None:
    for paired in (True, False):
        (forth, p), (back, same) = (
            barn_tables.compare(*pair, paired) for pair in ((one, other), (other, one))
        )
        assert (-back).value == pytest.approx(forth.value)
        assert ((-back).low, (-back).high) == pytest.approx((forth.low, forth.high), nan_ok=True)
        assert p == pytest.approx(same, nan_ok=True)


def test_the_interval_of_searches_is_students() -> None:
    interval = barn_tables.student(np.array([1.0, 2.0, 3.0, 4.0, 5.0]))
    half = 2.7764 * np.sqrt(2.5 / 5)  # the 97.5 % quantile of t with 4 degrees of freedom
    assert (interval.low, interval.high) == pytest.approx((3 - half, 3 + half), abs=1e-4)


def test_searches_that_do_not_differ_are_told_so() -> None:
    same = np.array([0.1, 0.2, 0.3])
    assert barn_tables.compare(same, same, paired=True)[1] == 1.0


tables = st.dictionaries(
    st.sampled_from(["one", "two"]), st.text("|-ab 1\n", min_size=1).map(str.strip)
)


@given(tables)
def test_tables_fill_their_marks_and_nothing_else(tables: dict[str, str]) -> None:
    marks = "<!-- measured: {} -->\n\n{}\n\n<!-- end -->"
    page = (
        "\nhead\n"
        + "\nbetween\n".join(marks.format(name, "old") for name in ("one", "two"))
        + "\ntail"
    )
    filled = barn_tables.fill(page, tables)
    for name in ("one", "two"):
        assert marks.format(name, tables.get(name, "old")) in filled
    assert barn_tables.fill(page, {"without marks": "new"}) == page
    assert barn_tables.fill(filled, dict.fromkeys(("one", "two"), "old")) == page


designs = st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=12)


@given(designs)
def test_each_design_of_a_front_is_above_all_that_cost_no_more(
    pairs: list[tuple[int, int]],
) -> None:
    missions = {
        i: pd.DataFrame({"price": [price], "score": [score]})
        for i, (price, score) in enumerate(pairs)
    }
    front = barn.list_front(barn_tables.summarize(missions))
    best = max(score for _, score in pairs)
    assert [pairs[one] for one in front] == sorted({pairs[one] for one in front})
    assert pairs[front[-1]][1] == best
    for one in front:
        cheaper = [score for price, score in pairs if price <= pairs[one][0]]
        assert pairs[one][1] == max(cheaper)
