"""The study of docs/redundancy.md: failed sensors are as none, expectations, pairs and searches."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import drop_out
import numpy as np
import pandas as pd
import pytest
import redundancy_searches
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tabulated import EXPERIMENT, Table, Tabulated, list_places

import evoros
from evoros.base.arrays import Array
from evoros.design.design import Design
from evoros.evolution.loop import evolve
from evoros.mission.mission import Outcome
from evoros.sensor.protocol import Mount

PLACES = 4
unhurried = settings(deadline=None, max_examples=40)
vectors = arrays(np.float64, 1 << PLACES, elements=st.floats(-10, 10))
rates = st.floats(0, 1)


@pytest.fixture(scope="module")
def places() -> dict[str, Mount]:
    return list_places()


def fly(mounts: Sequence[Mount], *overrides: str) -> pd.DataFrame:
    """One mission of a design in each of two worlds; the same draws for all."""
    short = ["world=[boxes,blocks]", "trials=1", "executor=serial", "course.time_limit_s=200.0"]
    with evoros.Evaluator([EXPERIMENT, *short, *overrides]) as evaluator:
        return evaluator.missions([Design(tuple(mounts))])


@pytest.mark.parametrize("failed", [[0], [1, 2], [0, 1, 2, 3]])
def test_a_sensor_that_is_silent_from_the_start_is_as_none(
    failed: list[int], places: dict[str, Mount]
) -> None:
    mounts = list(places.values())[1:5]
    survivors = [mount for i, mount in enumerate(mounts) if i not in failed]
    with_failure = fly(mounts, "failure=given", f"failure.sensors={failed}")
    without = fly(survivors, "failure=none")
    of_failure = ["sensors", "price", "failed_sensors", "failed_at_s", "failed_by"]
    pd.testing.assert_frame_equal(
        with_failure.drop(columns=of_failure), without.drop(columns=of_failure), check_exact=True
    )
    assert len(set(with_failure.failed_sensors)) == 1
    assert set(with_failure.sensors) == {4}


def test_with_noise_a_silent_sensor_shifts_the_noise_of_others(places: dict[str, Mount]) -> None:
    """Then the identity holds for expectations alone."""
    mounts, noisy = list(places.values())[1:5], "design.sensors.sonar.filters.noise.sigma_m=0.05"
    with_failure = fly(mounts, "failure=given", "failure.sensors=[0]", noisy)
    without = fly(mounts[1:], "failure=none", noisy)
    assert with_failure.distance_m.tolist() != without.distance_m.tolist()


def enumerate_survivors(members: int) -> list[tuple[int, int]]:
    """The survivors of each set of failed sensors, and how many failed."""
    subsets = [s for s in range(1 << PLACES) if s & members == s]
    return [(s, (members ^ s).bit_count()) for s in subsets]


@unhurried
@given(vectors, rates)
def test_drop_out_weighs_every_set_of_survivors(scores: Array, rate: float) -> None:
    expected = drop_out.drop_out(scores, rate)
    for members in range(1 << PLACES):
        terms = [
            rate**failed * (1 - rate) ** survivors.bit_count() * scores[survivors]
            for survivors, failed in enumerate_survivors(members)
        ]
        assert expected[members] == pytest.approx(sum(terms), abs=1e-9)


@unhurried
@given(vectors)
def test_one_failure_weighs_the_sets_without_one_sensor(scores: Array) -> None:
    for members in range(1 << PLACES):
        left = [scores[s] for s, failed in enumerate_survivors(members) if failed == 1]
        left = left or [scores[0]]
        assert drop_out.fail_one(scores)[members] == pytest.approx(np.mean(left))
        assert drop_out.fail_worst(scores)[members] == min(left)


@unhurried
@given(vectors, rates)
def test_a_backup_is_lost_only_with_its_sensor(scores: Array, rate: float) -> None:
    expected = drop_out.back_up(scores, rate)
    assert expected[0] == pytest.approx(drop_out.drop_out(scores, rate)[-1])
    assert expected[-1] == pytest.approx(drop_out.drop_out(scores, rate**2)[-1])
    total = 0.0  # with a backup at place 0 alone
    for fails in product((False, True), repeat=PLACES + 1):
        lost = [fails[0] and fails[-1], *fails[1:PLACES]]
        survivors = sum(1 << i for i in range(PLACES) if not lost[i])
        total += rate ** sum(fails) * (1 - rate) ** (PLACES + 1 - sum(fails)) * scores[survivors]
    assert expected[1] == pytest.approx(total, abs=1e-9)


@unhurried
@given(arrays(np.float64, (PLACES, PLACES), elements=st.floats(-5, 5)), rates, st.data())
def test_pairs_are_exact_if_the_truth_is_pairwise(
    weights: Array, rate: float, data: st.DataObject
) -> None:
    bits = np.arange(1 << PLACES)[:, None] >> np.arange(PLACES) & 1
    scores = np.einsum("si,ij,sj->s", bits, weights, bits) + 3.0
    around = data.draw(st.integers(0, (1 << PLACES) - 1))
    some = np.append(0, drop_out.within(PLACES, data.draw(st.integers(2, PLACES))))
    for fitted in (drop_out.near(PLACES, around), some):
        approximate = drop_out.make_fit(PLACES, fitted) @ scores
        assert np.allclose(approximate, scores, atol=1e-9)
        truth = drop_out.drop_out(scores, rate)
        assert np.allclose(drop_out.drop_out(approximate, rate), truth, atol=1e-9)


@unhurried
@given(vectors)
def test_the_fit_near_a_set_is_its_expansion_to_second_order(scores: Array) -> None:
    fit = drop_out.make_fit(PLACES, drop_out.near(PLACES, 0)) @ scores
    single = [scores[1 << i] - scores[0] for i in range(PLACES)]
    both = scores[0b11] - scores[0b10] - scores[0b01] + scores[0]
    assert fit[0b11] == pytest.approx(scores[0b11], abs=1e-9)
    assert fit[0b111] - fit[0b110] - fit[0b101] + fit[0b100] == pytest.approx(both, abs=1e-9)
    assert fit[0b1000] == pytest.approx(scores[0] + single[3], abs=1e-9)


@unhurried
@given(vectors, st.integers(1, PLACES))
def test_the_best_set_keeps_the_budget(scores: Array, budget: int) -> None:
    best = drop_out.find_best(scores, budget)
    assert 1 <= best.bit_count() <= budget
    rivals = [s for s in range(1, 1 << PLACES) if s.bit_count() <= budget]
    assert scores[best] == max(scores[s] for s in rivals)


@pytest.fixture(scope="module")
def table(places: dict[str, Mount]) -> Table:
    """Outcomes that no simulator made: progress by the number of the set, in two trials."""
    blank = Outcome.failure("collision", "", 540.0, 0)
    outcomes = {
        (members, world): [
            replace(blank, progress=(members + trial) / 257, completed=False) for trial in (0, 1)
        ]
        for members, world in product(range(256), ("boxes", "maze", "blocks"))
    }
    return Table(list(places.values()), outcomes)


@pytest.mark.parametrize("rate", [0.0, 1.0])
def test_a_looked_up_mission_is_that_of_the_survivors(
    rate: float, places: dict[str, Mount], table: Table
) -> None:
    overrides = [EXPERIMENT, f"failure.probability={rate}"]
    experiment = evoros.compose(overrides).build()
    journal = Tabulated(experiment, table)
    design = Design(tuple(list(places.values())[:2]))
    for mission in experiment.plan.selection(3, 7, design):
        (outcome,) = journal.find(mission)
        members = 0b11 if rate == 0.0 else 0
        assert outcome in table.outcomes[members, mission.world]


def test_a_failure_that_begins_later_is_refused(places: dict[str, Mount], table: Table) -> None:
    experiment = evoros.compose([EXPERIMENT, "failure=random"]).build()
    design = Design(tuple(list(places.values())[:2]))
    (mission, *_) = experiment.plan.selection(0, 0, design)
    with pytest.raises(ValueError, match=r"failure\.latest_s=0"):
        Tabulated(experiment, table).find(mission)


@pytest.mark.parametrize("failure", redundancy_searches.FAILURES)
def test_a_search_keeps_the_budget_and_repeats(
    failure: str, table: Table, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(redundancy_searches, "BUDGET", 400)
    runs: list[Any] = [
        redundancy_searches.search(table, failure, redundancy_searches.BASELINE, [5])
        for _ in range(2)
    ]
    assert repr(runs[0]) == repr(runs[1])
    assert all(row["missions"] <= 400 and 1 <= row["set"].bit_count() <= 4 for row in runs[0])
    assert all(row["regret"] >= 0 and row["found"] == (row["regret"] == 0) for row in runs[0])


def test_the_adversary_can_strike_every_sensor(places: dict[str, Mount], table: Table) -> None:
    overrides = [EXPERIMENT, "trials=8", "optimizer=random_search", "optimizer.population_size=4"]
    overrides += redundancy_searches.FAILURES["the worst one"][0] + redundancy_searches.COMMON
    experiment: Any = evoros.compose(overrides).build()
    struck: set[int] = set()

    class Watching(Tabulated):
        def find(self, mission: Any) -> Any:
            struck.update(mission.case.sensors)
            return super().find(mission)

    journal: Any = Watching(experiment, table)
    with experiment.executor.open() as pool:
        evolve(experiment, journal, journal, 12, pool)
    assert struck == {0, 1, 2, 3}
