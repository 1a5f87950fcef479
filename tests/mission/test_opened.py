"""Missions that run part by part: the bits of whole ones, and faults that come on their way."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.base.arrays import YAW
from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.failure.given import GivenFailure
from evoros.failure.none import NoFailure
from evoros.failure.protocol import Failure
from evoros.failure.random import RandomFailure
from evoros.filter.protocol import Filter
from evoros.filter.silence import Silence
from evoros.filter.stuck import Stuck
from evoros.mission.compiled_loop import prepare, prepare_interpreted
from evoros.mission.inputs import Prepare
from evoros.mission.mission import Mission
from evoros.mission.opened import OpenMission, open_mission
from evoros.mission.outcome import STEER
from evoros.mission.rollout import run_mission
from evoros.mission.scenario import Scenario


@cache
def experiment_of(*overrides: str) -> Experiment:
    return compose(["world=maze", "course.time_limit_s=30", *overrides]).build()


def flight_of(*overrides: str) -> tuple[Scenario, Mission]:
    experiment = experiment_of(*overrides)
    design = experiment.space.decode(np.full(experiment.space.size, 0.5))
    return experiment.scenario, experiment.plan.evaluation(0, 0, design)[0]


@contextmanager
def opened(scenario: Scenario, mission: Mission, loop: Prepare = prepare) -> Iterator[OpenMission]:
    with open_mission(scenario, scenario.equip(mission.design), mission, loop) as flown:
        yield flown


@settings(max_examples=10)
@given(parts=st.lists(st.integers(1, 90), max_size=6))
def test_parts_have_the_bits_of_the_whole(parts: list[int]) -> None:
    scenario, mission = flight_of("failure=random", "failure.earliest_s=2", "failure.latest_s=20")
    outcomes, whole = run_mission(scenario, mission)
    with opened(scenario, mission) as flown:
        for ticks in parts:
            flown.run(ticks)
        flown.run()
        assert flown.is_over
        assert flown.trajectory.tobytes() == whole.tobytes()
        assert repr(flown.outcomes()) == repr(outcomes)


@pytest.mark.parametrize(
    ("simulator", "loop"), [("physics", prepare), ("planar", prepare_interpreted)]
)
def test_parts_of_any_loop_have_the_bits_of_the_whole(simulator: str, loop: Prepare) -> None:
    scenario, mission = flight_of(f"simulator={simulator}", "course.time_limit_s=3")
    _, whole = run_mission(scenario, mission)
    with opened(scenario, mission, loop) as flown:
        while not flown.is_over:
            flown.run(7)
        assert flown.trajectory.tobytes() == whole.tobytes()


@pytest.mark.parametrize("effect", [Silence(), Stuck()])
@pytest.mark.parametrize("after", [1, 48, 200])
def test_a_fault_on_the_way_is_the_fault_that_was_stated_before(effect: Filter, after: int) -> None:
    scenario, mission = flight_of()
    with opened(scenario, mission) as flown:
        flown.run(after)
        (fault,) = flown.add_failure(GivenFailure((0, 3), 0.0, effect))
        flown.run()
        later, rows = flown.outcomes(), flown.trajectory.copy()
    onset = float(fault.onset[0])
    assert onset == pytest.approx(after * 0.1)
    stated = replace(scenario, failure=GivenFailure((0, 3), onset, effect))
    outcomes, whole = run_mission(stated, mission)
    assert rows.tobytes() == whole.tobytes()
    assert repr(later) == repr(outcomes)


def test_later_faults_of_one_name_draw_from_streams_of_their_own() -> None:
    scenario, mission = flight_of()
    with opened(scenario, mission) as flown:
        flown.run(10)
        first = flown.add_failure(RandomFailure())
        second = flown.add_failure(RandomFailure())
        assert [list(f.onset) for f in first] != [list(f.onset) for f in second]
        assert all((fault.onset >= 1.0).all() for fault in (*first, *second))


@pytest.mark.parametrize("failure", [NoFailure(), GivenFailure((), 0.0)])
def test_a_failure_of_nothing_changes_nothing(failure: Failure) -> None:
    scenario, mission = flight_of()
    _, whole = run_mission(scenario, mission)
    with opened(scenario, mission) as flown:
        flown.run(50)
        assert flown.add_failure(failure) == ()
        flown.run()
        assert flown.trajectory.tobytes() == whole.tobytes()


def test_a_command_from_outside_holds_until_the_next_decision() -> None:
    scenario, mission = flight_of()
    with opened(scenario, mission) as flown:
        flown.run(1)
        before = float(flown.state[YAW])
        for _ in range(20):
            flown.command(0.3, 0.3)
            flown.run(1)
        assert flown.trajectory[:20, STEER].tolist() == [0.3] * 20
        assert float(flown.state[YAW]) > before + 0.1  # to the left
        decided = flown.trajectory[20, STEER]
        flown.run(1)
        assert flown.trajectory[20, STEER] == decided  # the controller's again


def test_faults_of_other_parts_do_not_come_amid_a_mission() -> None:
    """A place, a waypoint or a drive must be known when the mission begins."""
    scenario, mission = flight_of()
    failure = experiment_of("failure=steering").failure
    with opened(scenario, mission) as flown:
        flown.run(10)
        with pytest.raises(InputError, match=r"must fail sensors at times"):
            flown.add_failure(failure)


def test_nobody_drives_past_the_faults_of_a_drive() -> None:
    scenario, mission = flight_of("failure=drive")
    with opened(scenario, mission) as flown:
        flown.run(10)
        with pytest.raises(InputError, match=r"leave commands, steering and drive alone"):
            flown.command(0.3, 0.3)
