"""MuJoCo gives the same bits in every process, and after any other mission."""

import hashlib
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from helpers import ROOT
from proposal_sites import is_of
from pybullet_cases import level, mission, short_experiment

from evoros.base.arrays import SPEED, STATE_SIZE
from evoros.base.errors import SimulationError
from evoros.evolution.experiment import Experiment
from evoros.formats.urdf.tree import UrdfDocument
from evoros.mission.rollout import run_mission
from evoros.simulator.mujoco import Mujoco, models
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import Simulator, open_alone
from evoros.simulator.pybullet import PyBullet
from evoros.world.model import World

DIGEST = """
import sys
sys.path[:0] = [{folder!r}, {folder!r} + "/simulator"]
from test_mujoco import digest_of_missions
print(digest_of_missions())
"""


def digest_of_missions() -> str:
    """A digest of every bit of a mission in each world, the second time from a kept model."""
    experiment, digest = short_experiment(), hashlib.sha256()
    scenario = replace(experiment.scenario, simulator=Mujoco())
    for world in [*experiment.world, *experiment.world]:
        (outcome,), track = run_mission(scenario, mission(experiment, world))
        digest.update(track.tobytes() + repr(outcome).encode())
    return digest.hexdigest()


@pytest.mark.slow
def test_missions_repeat_in_a_process_and_in_a_fresh_one() -> None:
    first = digest_of_missions()
    models.cache_clear()
    assert digest_of_missions() == first
    fresh = subprocess.run(
        [sys.executable, "-c", DIGEST.format(folder=str(ROOT / "tests"))],
        capture_output=True,
        text=True,
    )
    assert fresh.stdout.strip() == first, fresh.stderr


@pytest.mark.parametrize("world", ["boxes", "blocks"])
def test_a_mission_does_not_depend_on_those_before(experiment: Experiment, world: str) -> None:
    scenario = replace(experiment.scenario, simulator=Mujoco())
    wanted = mission(experiment, world, 1)
    models.cache_clear()
    _, alone = run_mission(scenario, wanted)
    for before in (
        mission(experiment, world, 1, trial=1),  # the same robot and world
        mission(experiment, world, 2),  # another robot
        mission(experiment, "maze", 1),  # another world
    ):
        run_mission(scenario, before)
        _, after = run_mission(scenario, wanted)
        assert np.array_equal(after, alone, equal_nan=True)


def test_a_disturbed_world_is_whole_again_in_the_next_mission(experiment: Experiment) -> None:
    """The rover pushes a box away; the same model starts again with the box where it was."""
    box = next(body for body in experiment.world["blocks"].bodies if body.mass is not None)
    ahead = replace(box, pose=replace(box.pose, position=(0.6, 0.0, 0.0715)))
    world, states = level(experiment, ahead), []
    for _ in range(2):
        with open_alone(Mujoco().open, experiment.robot, world) as simulation:
            state = np.zeros(STATE_SIZE)
            simulation.advance(np.array([0.3, 0.1]), 4.0)
            simulation.observe(state)
            states.append(state)
    assert np.array_equal(states[0], states[1])


def test_another_drive_or_home_on_the_same_model_is_obeyed(experiment: Experiment) -> None:
    world, state = level(experiment), np.zeros(STATE_SIZE)
    for limit in (0.397, 0.2):
        slow = replace(experiment.robot.drive, max_speed_mps=limit)  # type: ignore[type-var]
        with open_alone(
            Mujoco().open, replace(experiment.robot, drive=slow), at(world, limit)
        ) as simulation:
            simulation.observe(state)
            assert state[:3] == pytest.approx([limit, 0.0, limit])
            simulation.advance(np.array([1.0, 0.0]), 3.0)
            simulation.observe(state)
        assert state[SPEED] == pytest.approx(limit, rel=0.002)


def at(world: World, x: float) -> World:
    """The same world, with home at x [m], turned by x [rad]."""
    return replace(world, course=replace(world.course, home_x_m=x, home_yaw_rad=x))


def test_other_simulators_open_a_robot_that_mujoco_cannot_compile() -> None:
    experiment = short_experiment()
    text = re.sub('ixx="[^"]*"', 'ixx="100"', experiment.robot.engine_text, count=1)
    uneven = replace(experiment.robot, engine_urdf=UrdfDocument(text))  # more than iyy + izz

    def open_in(simulator: Simulator) -> None:
        with open_alone(simulator.open, uneven, experiment.world["boxes"]):
            pass

    with pytest.raises(SimulationError) as refused:
        open_in(Mujoco())
    key = "evoros/simulator/engines/mujoco_model.py simulator=pybullet"
    assert is_of(str(refused.value), key)
    open_in(PyBullet())
    open_in(Planar())
