"""Missions that run part by part: the bits of whole ones, faults on their way, and filters."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mission_cases import run_interpreted
from numpy.random import Generator
from sensor_cases import equip, start_chain

from evoros.base.arrays import YAW, Array
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.failure.combined import CombinedFailure
from evoros.failure.given import GivenFailure
from evoros.failure.none import NoFailure
from evoros.failure.onset.place import PlaceOnset
from evoros.failure.onset.protocol import Onset
from evoros.failure.onset.time import TimeOnset
from evoros.failure.onset.use import UseOnset
from evoros.failure.onset.waypoint import WaypointOnset
from evoros.failure.part import PartFailure
from evoros.failure.protocol import Failure, Fault
from evoros.failure.random import RandomFailure
from evoros.filter.constant import Constant
from evoros.filter.gaussian_noise import GaussianNoise
from evoros.filter.limit import Limit
from evoros.filter.pose_jump import PoseJump
from evoros.filter.protocol import Channels, Filter
from evoros.filter.silence import Silence
from evoros.filter.stuck import Stuck
from evoros.mission.compiled_loop import run_call
from evoros.mission.inputs import Run
from evoros.mission.mission import AT_X, AT_Y, STEER, TIME, VISITED, Mission
from evoros.mission.rollout import open_mission, run_mission
from evoros.mission.scenario import Scenario
from evoros.sensor.odometry import Odometry
from evoros.testing import place_sensors

PARTS: dict[str, Filter] = {
    "commands": Limit(0.15),
    "steering": Stuck(),
    "drive": Limit(0.1),
    "left_wheel": Constant(0.6),
    "localization": PoseJump(),
}
"""An effect on each part, in the order of their signals, without draws and without a past."""


@dataclass(frozen=True)
class Stated(Failure):
    """Faults that are known."""

    faults: tuple[Fault, ...]
    parts: ClassVar[Sequence[str]] = (*PARTS,)

    def draw(self, channels: Any, rng: Any) -> tuple[Fault, ...]:
        return self.faults


@cache
def experiment_of(*overrides: str) -> Experiment:
    return compose(["world=maze", "course.time_limit_s=30", *overrides]).build()


def flight_of(*overrides: str) -> tuple[Scenario, Mission]:
    experiment = experiment_of(*overrides)
    design = experiment.space.decode(np.full(experiment.space.size, 0.5))
    return experiment.scenario, experiment.plan.evaluation(0, 0, design)[0]


@settings(max_examples=10)
@given(parts=st.lists(st.integers(1, 90), max_size=6))
def test_parts_have_the_bits_of_the_whole(parts: list[int]) -> None:
    scenario, mission = flight_of("failure=random", "failure.earliest_s=2", "failure.latest_s=20")
    outcomes, whole = run_mission(scenario, mission)
    with open_mission(scenario, mission) as flown:
        for ticks in parts:
            flown.run(ticks)
        flown.run()
        assert flown.is_over
        assert flown.trajectory.tobytes() == whole.tobytes()
        assert repr(flown.outcomes()) == repr(outcomes)


@pytest.mark.parametrize(
    ("simulator", "loop"), [("physics", run_call), ("planar", run_interpreted)]
)
def test_parts_of_any_loop_have_the_bits_of_the_whole(simulator: str, loop: Run) -> None:
    scenario, mission = flight_of(f"simulator={simulator}", "course.time_limit_s=3")
    _, whole = run_mission(scenario, mission)
    with open_mission(scenario, mission) as flown:
        while not flown.is_over:
            flown.run(7, loop)
        assert flown.trajectory.tobytes() == whole.tobytes()


@pytest.mark.parametrize("effect", [Silence(), Stuck()])
@pytest.mark.parametrize("after", [1, 48, 200])
def test_a_fault_on_the_way_is_the_fault_that_was_stated_before(effect: Filter, after: int) -> None:
    scenario, mission = flight_of()
    with open_mission(scenario, mission) as flown:
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
    with open_mission(scenario, mission) as flown:
        flown.run(10)
        first = flown.add_failure(RandomFailure())
        second = flown.add_failure(RandomFailure())
        assert [list(f.onset) for f in first] != [list(f.onset) for f in second]
        assert all((fault.onset >= 1.0).all() for fault in (*first, *second))


@pytest.mark.parametrize("failure", [NoFailure(), GivenFailure((), 0.0)])
def test_a_failure_of_nothing_changes_nothing(failure: Failure) -> None:
    scenario, mission = flight_of()
    _, whole = run_mission(scenario, mission)
    with open_mission(scenario, mission) as flown:
        flown.run(50)
        assert flown.add_failure(failure) == ()
        flown.run()
        assert flown.trajectory.tobytes() == whole.tobytes()


def test_a_command_from_outside_holds_until_the_next_decision() -> None:
    scenario, mission = flight_of()
    with open_mission(scenario, mission) as flown:
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


@pytest.mark.parametrize("loop", [run_call, run_interpreted])
@pytest.mark.parametrize("part", [*PARTS])
def test_a_part_that_fails_on_the_way_fails_as_if_it_was_stated_before(
    part: str, loop: Run
) -> None:
    scenario, mission = flight_of("robot=two_wheeler", "course.time_limit_s=20")
    with open_mission(scenario, mission) as flown:
        flown.run(48, loop)
        (fault,) = flown.add_failure(PartFailure(part, 1.0, TimeOnset(0.0, 0.0), PARTS[part]))
        assert flown.fails_parts
        flown.run(run=loop)
        later, rows = flown.outcomes(), flown.trajectory.copy()
    onset = float(fault.onset[0])
    assert onset == pytest.approx(4.8)
    stated = replace(scenario, failure=PartFailure(part, 1.0, TimeOnset(onset, onset), PARTS[part]))
    outcomes, whole = run_mission(stated, mission)
    assert rows.tobytes() == whole.tobytes()
    assert repr(later) == repr(outcomes)
    assert rows.tobytes() != run_mission(scenario, mission)[1].tobytes()


def test_each_of_several_parts_that_fail_one_after_another_keeps_its_state() -> None:
    """A steering stays stuck where it was, whatever fails behind and before it."""
    failures = [PartFailure(part, 1.0, TimeOnset(0.0, 0.0), PARTS[part]) for part in PARTS]
    scenario, mission = flight_of("robot=two_wheeler", "course.time_limit_s=20")
    with open_mission(scenario, mission) as flown:
        for failure in failures:
            flown.run(20)
            flown.add_failure(failure)
        flown.run()
        (outcome,), rows = flown.outcomes(), flown.trajectory.copy()
    assert outcome.failed_parts == (*PARTS,)
    rng = generator("", "failure")
    named = {
        part: PartFailure(part, 1.0, TimeOnset(at, at), PARTS[part])
        for part, at in zip(PARTS, outcome.parts_failed_at_s, strict=True)
    }
    faults = [fault for each in named.values() for fault in each.draw(place_sensors(0), rng)]
    _, whole = run_mission(replace(scenario, failure=Stated(tuple(faults))), mission)
    assert rows.tobytes() == whole.tobytes()


@pytest.mark.parametrize("event", ["waypoint", "place", "time", "way"])
@pytest.mark.parametrize("after", [80, 400])
def test_events_count_from_when_the_failure_comes(event: str, after: int) -> None:
    """The robot has reached the waypoint already, or not yet; a way and a time begin anew."""
    scenario, mission = flight_of("course.time_limit_s=60")
    _, whole = run_mission(scenario, mission)
    x, y = (float(value) for value in whole[after + 100, [AT_X, AT_Y]])
    way = np.cumsum(np.hypot(*np.diff(whole[:, [AT_X, AT_Y]], axis=0, prepend=whole[:1, 1:3]).T))
    onsets: dict[str, tuple[Onset, Any]] = {
        "waypoint": (WaypointOnset(1), whole[:, VISITED] >= 1),
        "place": (PlaceOnset(x, y, 0.5), np.hypot(whole[:, AT_X] - x, whole[:, AT_Y] - y) <= 0.5),
        "time": (UseOnset(5.0, 1.0, 0.0), whole[:, TIME] >= 0.1 * after + 5.0 - 1e-9),
        "way": (UseOnset(1.0, 0.0, 1.0), way >= way[after - 1] + 1.0),
    }
    onset, reached = onsets[event]
    with open_mission(scenario, mission) as flown:
        flown.run(after)
        flown.add_failure(PartFailure("drive", 1.0, onset, Limit(0.1)))
        flown.run()
        (outcome,), rows = flown.outcomes(), flown.trajectory.copy()
    (at_s,) = outcome.parts_failed_at_s
    first = int(np.flatnonzero(reached & (np.arange(len(whole)) >= after))[0])
    assert at_s == pytest.approx(whole[first, TIME], abs=1e-9)
    assert rows[: first + 1, AT_X].tolist() == whole[: first + 1, AT_X].tolist()


def test_nobody_drives_past_the_faults_of_a_drive() -> None:
    scenario, mission = flight_of("failure=drive")
    with open_mission(scenario, mission) as flown:
        flown.run(10)
        with pytest.raises(InputError, match=r"must not affect commands, steering or drive"):
            flown.command(0.3, 0.3)


def failing(effect: Filter, count: int = 1) -> RandomFailure:
    return RandomFailure(count, 0.0, 1.0, effect)


class Several(Failure):
    """The same noise on all sensors, so many times."""

    def __init__(self, times: int) -> None:
        self.times = times

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        return self.times * failing(GaussianNoise(0.2), channels.size).draw(channels, rng)


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return compose([]).build()


def heard(experiment: Experiment, failure: Failure, seconds: float = 3.0) -> Array:
    """(ticks, sensors): what the controller reads of constant ranges under the failure."""
    space = experiment.space
    design = space.decode(np.full(space.size, 0.5))
    robot = experiment.robot.with_sensors(design.mounts, experiment.design.sensors)
    draws = partial(generator, "test")
    faults = failure.draw(robot.describe_sensors(), draws("failure"))
    raw, readings = np.full(len(robot.mounts), 2.0), np.zeros(len(robot.mounts))
    chain = start_chain(robot, faults, raw, readings, draws)
    rows = []
    for tick in range(round(10 * seconds)):
        for stage in chain:
            stage.rule(*stage[2:7], 0.1 * tick)
        rows.append(readings.copy())
    return np.array(rows)


@pytest.mark.parametrize("added", [Silence(), GaussianNoise(0.3)])
@pytest.mark.parametrize("count", [1, 2])
def test_a_failure_added_before_another_does_not_shift_its_noise(
    experiment: Experiment, added: Silence | GaussianNoise, count: int
) -> None:
    noisy = failing(GaussianNoise(0.2))
    first = failing(added, count)
    alone = heard(experiment, CombinedFailure({"noisy": noisy}))
    both = heard(experiment, CombinedFailure({"first": first, "noisy": noisy}))
    intact = heard(experiment, CombinedFailure())
    hit = (alone != intact).any(axis=0)
    spared = hit & (heard(experiment, CombinedFailure({"first": first})) == intact).all(axis=0)
    assert hit.sum() == spared.sum() == 1  # the failures meet different sensors
    assert np.array_equal(alone[:, spared], both[:, spared])


def test_faults_of_one_name_have_draws_of_their_own(experiment: Experiment) -> None:
    intact, once, twice = (
        heard(experiment, failure) for failure in (Several(0), Several(1), Several(2))
    )
    assert not np.allclose(once[-1], intact[-1])
    assert not np.allclose(twice[-1] - intact[-1], 2 * (once[-1] - intact[-1]))


def test_each_sensor_reads_its_own_signal(experiment: Experiment) -> None:
    """Odometry divides what its own signal gained since the last reading by the time."""
    mounts = [("odometry", 0.0, 0.0, 0.0, 0.0)] * 2
    robot = equip(experiment.robot, *mounts, odometry=Odometry())
    signals, readings = np.array([0.1, 0.2, 0.3, 0.4]), np.zeros(4)
    for stage in start_chain(robot, (), signals, readings, partial(generator, "test")):
        stage.rule(*stage[2:7], 0.5)
    assert readings == pytest.approx(signals / 0.5)
