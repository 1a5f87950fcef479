"""The parts of docs/extending.md build, run, and change what they are meant to change."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from documents import commands
from examples import LIMIT, composed, short_run

from evoros.base.arrays import Array
from evoros.config.compose import compose
from evoros.config.options import parse_options
from evoros.evolution.experiment import Experiment
from evoros.mission.mission import Mission
from evoros.mission.outcome import Outcome
from evoros.mission.rollout import run_mission

MISSION_PARTS = ("robot", "sensor", "filter", "failure", "controller", "simulator")
"""Groups whose parts act in a mission; fitness, optimizer and executor do not."""


def quick(overrides: list[str]) -> Experiment:
    """The experiment in the example's simulator and world, unless they are chosen."""
    named = {word.split("=")[0] for word in overrides}
    defaults = {"simulator": "kinematic", "world": "yard", "executor": "serial"}
    added = [f"{group}={choice}" for group, choice in defaults.items() if group not in named]
    return compose([*added, *overrides, LIMIT], "mine").build()


def run_once(experiment: Experiment) -> tuple[Outcome, Array]:
    design = experiment.space.decode(np.linspace(0.1, 0.9, experiment.space.size))
    mission = Mission(0, 0, design, "yard", 0, "evaluation", "a key of draws")
    (outcome,), track = run_mission(experiment.scenario, mission)
    return outcome, track


@pytest.fixture(scope="module")
def baseline(mine: Path) -> Array:
    return run_once(quick([]))[1]


EXAMPLES = commands("extending")
IN_MISSION = [
    line for line in EXAMPLES if re.match(rf".*mine \+?({'|'.join(MISSION_PARTS)})\b", line)
]


# The tests below build the others with another simulator, whose time step may differ.
TYPED = [line for line in EXAMPLES if line not in IN_MISSION or "controller=" in line]


@pytest.mark.parametrize("line", TYPED)
def test_the_examples_of_parts_build(line: str, mine: Path) -> None:
    for config in composed(line):
        config.build()


@pytest.mark.parametrize("line", IN_MISSION)
def test_the_examples_of_parts_run_and_matter(line: str, mine: Path, baseline: Array) -> None:
    overrides = list(parse_options(shlex.split(line)[1:]).overrides)
    experiment = quick(overrides)
    outcome, trajectory = run_once(experiment)
    assert outcome.ended in ("completed", "collision", "time_limit")
    repeated = run_once(experiment)
    assert str(repeated[0]) == str(outcome)  # NaN differs from itself
    np.testing.assert_array_equal(repeated[1], trajectory)
    if overrides != ["simulator=kinematic"]:
        assert not np.array_equal(baseline, trajectory, equal_nan=True)


def test_the_example_of_a_robot_drives_in_pybullet(mine: Path) -> None:
    pytest.importorskip("pybullet")
    outcome, _ = run_once(quick(["robot=cart", "simulator=pybullet"]))
    assert outcome.ended == "time_limit"
    assert 1.0 < outcome.distance_m < 2.0  # 0.3 m/s for 5 s


def test_the_examples_of_optimizer_executor_and_fitness_run(mine: Path) -> None:
    serial = short_run("here", ["optimizer=hill_climber", "fitness=careful"])
    pooled = short_run("there", ["optimizer=hill_climber", "fitness=careful", "executor=standard"])
    lines = (serial.path / "missions.csv").read_text().splitlines()
    assert sorted(lines) == sorted((pooled.path / "missions.csv").read_text().splitlines())
    best = serial.generations.groupby("generation").fitness.max()
    assert best.is_monotonic_increasing
    first = serial.missions[serial.missions.purpose == "selection"].iloc[0]
    fitness = serial.generations.set_index("id").fitness[first.design]
    expected = first.progress + 0.5 * first.least_clearance_m
    assert float(np.max(fitness)) == pytest.approx(expected, abs=1e-12)
