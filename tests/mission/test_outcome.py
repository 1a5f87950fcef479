"""The metrics of a mission, from its trajectory alone."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from evoros.failure.protocol import Fault
from evoros.filter.silence import Silence
from evoros.mission.metrics import compute_progress, list_failures
from evoros.mission.mission import LOST, Outcome

ROUTE = np.array([[float(i), 0.0] for i in range(10)])


@given(st.integers(0, 9), st.floats(-50, 50), st.floats(-50, 50))
def test_progress_is_the_papers_for_ten_waypoints(visited: int, x: float, y: float) -> None:
    """10 for each waypoint, and 10 / max(distance - 1, 1) %, at most 99."""
    distance = math.dist((x, y), ROUTE[visited])
    percent = min(99.0, 10 * visited + 10 / max(distance - 1, 1))
    assert math.isclose(100 * compute_progress(np.array([x, y]), visited, ROUTE, 1.0), percent)


def test_progress_is_complete_only_at_the_end() -> None:
    assert compute_progress(ROUTE[9], 9, ROUTE, 1.0) == 0.99
    assert compute_progress(ROUTE[9], 10, ROUTE, 1.0) == 1.0


@given(st.lists(st.one_of(st.floats(0, 100), st.just(math.inf)), max_size=6), st.floats(0, 99))
def test_failures_are_those_that_began(onsets: list[float], end: float) -> None:
    failures = list_failures((Fault(Silence(), np.array(onsets)),), end)
    assert [index for index, _, _ in failures] == [i for i, at in enumerate(onsets) if at <= end]
    assert all(at == onsets[index] and effect == "silence" for index, at, effect in failures)


def test_a_lost_mission_has_done_nothing() -> None:
    lost = Outcome.failure(LOST, "two\nlines", 540.0, 6)
    assert (lost.ended, lost.reason, lost.time_limit_s, lost.sensors) == (
        "lost",
        "two lines",
        540.0,
        6,
    )
    assert (lost.progress, lost.time_s, lost.completed, lost.visited) == (0.0, 0.0, False, 0)
    assert math.isnan(lost.mean_speed_mps)
    assert lost.least_waypoint_distances_m == ()
