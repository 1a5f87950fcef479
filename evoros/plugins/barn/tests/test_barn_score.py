"""The score of the BARN challenge: its formula at and between its clips, and what fails."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

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
