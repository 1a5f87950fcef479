"""Missions that a kernel runs together have the bytes of missions that run one after another."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import pytest
from bundled_parts import kinds
from mission_cases import COMBINATIONS, assert_same, experiment_of, missions, run_together, same
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.compilation.device import Host
from evoros.compilation.named_rules import Started
from evoros.evolution.experiment import Experiment
from evoros.filter.protocol import Channels, Filter
from evoros.mission.batch import Batcher, NoKernel
from evoros.mission.mission import REFUSED
from evoros.mission.rollout import run_mission

SENSOR_FILTERS = sorted(set(kinds("filter")) - {"pose_drift", "pose_jump", "pose_noise"})
EVERY_FILTER = [f"+filter@design.sensors.sonar.filters.{name}={name}" for name in SENSOR_FILTERS]
EVERY_FILTER += ["design.sensors.sonar.filters.constant.value=1.0"]
EVERY_FILTER += [
    f"+filter@controller.localization.{name}={name}"
    for name in ("pose_drift", "pose_jump", "pose_noise")
]

TOGETHER = [
    *COMBINATIONS,
    EVERY_FILTER,
    ["agents=oncoming", "failure=random"],
    ["world=generated", "controller/avoidance=blind", "course.end_on_collision=false"],
    ["world=rooms", "robot=courier", "design=around", "controller=indoor"],
]


@cache
def batcher() -> Batcher:
    """One kernel learns the rules of all tests."""
    return Batcher(Host())


LONG = "course.time_limit_s=100"  # so that failures come
PLACES = {"sensor": "+sensor@design.sensors.extra"}
GROUPS = ["failure", "sensor", "controller", "controller/avoidance", "robot", "walkers"]
GROUPS += ["controller/localization", "controller/navigation", "simulator", "failure/onset"]
NEEDED = {
    "controller=ardupilot": ["controller.binary=/bin/true"],
    "controller=program": ["controller.command=[/bin/true]"],
    "controller=ros1": ["controller.nodes=[[/bin/true]]"],
    "controller=ros2": ["controller.nodes=[[/bin/true]]"],
    "robot=courier": ["design=around"],
    "sensor=infrared": ["controller.avoidance.range_m=0.7"],
    "controller/localization=dead_reckoning": ["design=reckoning"],
    **{f"failure/onset={name}": ["failure=drive"] for name in kinds("failure/onset")},
}
"""What a choice needs to be complete."""
LEFT_OUT = {"robot=own", *(f"failure={name}" for name in ("adversarial", "exhaustive", "given"))}
"""A choice that reads a user's files, and those that draw what another one draws."""
ON_CPU = {f"controller={name}" for name in ("ardupilot", "program", "ros1", "ros2")}
ON_CPU |= {f"simulator={name}" for name in ("gazebo", "mujoco", "physics", "pybullet")}
"""Choices whose missions have no kernel."""


def choose(group: str) -> dict[str, Experiment]:
    """An experiment with each choice of a group, by the choice."""
    chosen = {}
    for name in kinds(group):
        choice, place = f"{group}={name}", PLACES.get(group, group)
        if choice not in LEFT_OUT:
            chosen[choice] = experiment_of(LONG, f"{place}={name}", *NEEDED.get(choice, []))
    return chosen


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_missions_with_each_choice_of_each_group_run_together_or_have_no_kernel() -> None:
    """A new part is among them by its YAML file, a filter by those that are chosen together.

    All are one launch, because the kernel is made again for each launch with new rules.
    """
    chosen = {choice: one for group in GROUPS for choice, one in choose(group).items()}
    chosen |= {" ".join(overrides): experiment_of(*overrides) for overrides in TOGETHER}
    # Whether a failure comes depends on the world.
    flown = {c: missions(one, 1)[: None if "failure" in c else 1] for c, one in chosen.items()}
    asked = [(chosen[choice].scenario, some) for choice, some in flown.items()]
    differ, without = [], set()
    for choice, answer in zip(chosen, batcher().run(asked), strict=True):
        scenario = chosen[choice].scenario
        if isinstance(answer, NoKernel):
            without.add(choice)
        elif not all(map(same, answer, (run_mission(scenario, one) for one in flown[choice]))):
            differ.append(choice)
    assert not differ
    assert without == ON_CPU


def test_a_mission_that_cannot_be_opened_leaves_the_others_alone() -> None:
    experiment = experiment_of(*COMBINATIONS[1])
    chosen = missions(experiment, 2)
    design = replace(chosen[0].design, values={"controller.avoidance.range_m": -1.0})
    chosen[0] = replace(chosen[0], design=design)
    together = run_together(batcher(), experiment, chosen)
    assert together[0][0][0].ended == REFUSED
    for mission, result in zip(chosen, together, strict=True):
        assert same(result, run_mission(experiment.scenario, mission))


def in_python(values: Array) -> None:
    """A rule that numba cannot compile."""
    for i in map(int, sorted(map(str, range(len(values))))):
        values[i] *= 1.0


def with_a_copy(values: Array) -> None:
    """A rule that makes an array."""
    for i, value in enumerate(values.copy()):
        values[i] = value


@dataclass(frozen=True)
class Odd(Filter):
    """A filter with such a rule."""

    rule: Callable[..., None]
    name = "odd"

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Started:
        return None


@pytest.mark.slow
def test_missions_with_odd_rules_have_no_kernel() -> None:
    experiment = experiment_of(*COMBINATIONS[1])
    sonar: Any = experiment.design.sensors["sonar"]
    reasons = {in_python: "is not compiled: ", with_a_copy: "creates arrays or other objects"}
    for rule, reason in reasons.items():
        sensors = {"sonar": replace(sonar, filters={"odd": Odd(rule)})}
        odd = replace(experiment, design=replace(experiment.design, sensors=sensors))
        with pytest.raises(NoKernel, match=rf"test_batch\.{rule.__name__} {reason}") as caught:
            run_together(batcher(), odd, missions(odd, 1))
        assert "\n" not in str(caught.value)
    assert_same(experiment, batcher())


def test_so_have_missions_in_a_live_engine() -> None:
    experiment = experiment_of("simulator=physics")
    with pytest.raises(NoKernel, match="the simulator or a controller cannot be compiled"):
        run_together(batcher(), experiment, missions(experiment, 1))
