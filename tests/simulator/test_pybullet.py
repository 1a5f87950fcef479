"""PyBullet gives the same bits in every process, and after any other mission."""

import math
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fixture_types import Patch
from helpers import ROOT
from lxml import etree
from proposal_sites import is_of
from pybullet_cases import beam, box, digest_of_missions, level, mission, mount_sensors

from evoros.base.arrays import CONTACT, SPEED, STATE_SIZE, YAW, Array, X, Y
from evoros.base.errors import SimulationError
from evoros.evolution.experiment import Experiment
from evoros.geometry.shapes import Body
from evoros.mission.rollout import run_mission
from evoros.sensor.sonar import Sonar
from evoros.simulator.engines.pybullet_bodies import load_urdf
from evoros.simulator.engines.pybullet_model import Client, import_pybullet
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.protocol import Simulator, open_alone
from evoros.simulator.pybullet import IDLE, PyBullet

DIGEST = """
import sys
sys.path.insert(0, {folder!r})
from pybullet_cases import digest_of_missions, short_experiment
print(digest_of_missions(short_experiment()))
"""

pytestmark = pytest.mark.usefixtures("own_engines")


@pytest.mark.slow
def test_missions_repeat_in_a_process_and_in_a_fresh_one(experiment: Experiment) -> None:
    first = digest_of_missions(experiment)
    assert digest_of_missions(experiment) == first
    fresh = subprocess.run(
        [sys.executable, "-c", DIGEST.format(folder=str(ROOT / "tests"))],
        capture_output=True,
        text=True,
    )
    assert fresh.stdout.strip() == first, fresh.stderr


@pytest.mark.parametrize("world", ["boxes", "maze", "blocks"])
def test_a_mission_does_not_depend_on_those_before(experiment: Experiment, world: str) -> None:
    wanted = mission(experiment, world, 1)
    IDLE.close()
    _, alone = run_mission(experiment.scenario, wanted)
    for before in (
        mission(experiment, world, 1, trial=1),  # the same robot and world: reset
        mission(experiment, world, 2),  # another robot
        mission(experiment, "maze" if world != "maze" else "boxes", 1),  # another world
    ):
        run_mission(experiment.scenario, before)
        _, after = run_mission(experiment.scenario, wanted)
        assert np.array_equal(after, alone, equal_nan=True)


@pytest.mark.parametrize("steps", [1, 2, 7, 60, 400])
def test_a_reset_gives_the_bits_of_a_rebuild(experiment: Experiment, steps: int) -> None:
    world, command = experiment.world["maze"], np.array([0.35, 0.4])
    robot = mount_sensors(experiment, Sonar(), (0.2, 0.0, 0.166, 0.0, 12.5))
    tracks, models = [], []
    for rebuild in (True, False):
        with open_alone(PyBullet().open, robot, world) as simulation:
            simulation.advance(command, 0.02 * steps)  # leaves contacts behind
        if rebuild:
            IDLE.close()
        with open_alone(PyBullet().open, robot, world) as simulation:
            models.append(simulation._model)
            tracks.append(track(simulation, 40))
    assert np.array_equal(tracks[0], tracks[1])
    assert models[1] is models[0]  # the second was a reset of the first, which was rebuilt


def track(simulation: Any, ticks: int) -> Array:
    state, reading = np.zeros(STATE_SIZE), np.zeros(1)
    rows = []
    for tick in range(ticks):
        simulation.advance(np.array([0.3, 0.5 * math.sin(tick)]), 0.1)
        simulation.observe(state)
        simulation.sense(reading)
        rows.append([*state, *reading])
    return np.array(rows)


def test_a_model_is_kept_where_nothing_was_disturbed(experiment: Experiment) -> None:
    still, light = experiment.world["boxes"], level(experiment, box("light", 0.9, mass=1.0))
    models = []
    for world in (still, still, light, light):
        with open_alone(PyBullet().open, experiment.robot, world) as simulation:
            models.append(simulation._model)
            simulation.advance(np.array([0.39, 0.0]), 3.0)
    assert models[0] is models[1]
    assert models[2] is not models[3]


def test_a_box_that_was_only_approached_is_put_back(experiment: Experiment) -> None:
    """The engine wakes a body nearby; awake, it settles, though nothing has touched it."""
    world = level(experiment, box("near", 0.0, 0.71, mass=50.0))
    tracks = []
    for _ in range(2):
        with open_alone(
            PyBullet().open, mount_sensors(experiment, beam(), (0, 0.1, 0.1, 90, 0)), world
        ) as opened:
            tracks.append(track(opened, 5))
            assert not tracks[-1][:, CONTACT].any()
    assert np.array_equal(tracks[0], tracks[1])


def test_another_drive_on_the_same_model_is_obeyed(experiment: Experiment) -> None:
    world, state = level(experiment), np.zeros(STATE_SIZE)
    for limit in (0.397, 0.2):
        slow = replace(experiment.robot.drive, max_speed_mps=limit)  # type: ignore[type-var]
        with open_alone(
            PyBullet().open, replace(experiment.robot, drive=slow), world
        ) as simulation:
            simulation.advance(np.array([1.0, 0.0]), 3.0)
            simulation.observe(state)
        assert state[SPEED] == pytest.approx(limit, rel=0.02)


def test_merged_links_move_as_the_separate_ones(experiment: Experiment, monkeypatch: Patch) -> None:
    design = mission(experiment, "boxes", 4).design
    robot = experiment.robot.with_sensors(design.mounts, experiment.design.sensors)
    tracks = []
    for separate in (False, True):
        IDLE.close()
        if separate:
            merging = "evoros.simulator.engines.pybullet_robot.merge_fixed_links"
            monkeypatch.setattr(
                merging, lambda root, kept: etree.tostring(root, encoding="unicode")
            )
        state, rows = np.zeros(STATE_SIZE), []
        with open_alone(PyBullet().open, robot, level(experiment)) as simulation:
            joints = simulation._bullet.getNumJoints(simulation._model.robots[0].body)
            assert joints == 6 + separate * len(design.mounts)
            for tick in range(100):
                simulation.advance(np.array([0.3, 0.4 * math.sin(0.06 * tick)]), 0.1)
                simulation.observe(state)
                rows.append(state[[X, Y, YAW]])
        tracks.append(np.array(rows))
    assert np.abs(tracks[0] - tracks[1]).max() < 1e-3
    assert np.ptp(tracks[0][:, 0]) > 2.0


BLOCK = '<collision><origin xyz="{x} 0 1"/><geometry>{shape}</geometry></collision>'
TETRAHEDRON = '<convex corners="0 0 0 0.004 0 0 0 0.004 0 0 0 0.004"/>'


@pytest.mark.parametrize("shape", ['<box size="0.004 0.004 0.004"/>', TETRAHEDRON])
def test_a_link_of_500_parts_is_read_as_a_whole(shape: str) -> None:
    parts = "".join(BLOCK.format(x=0.01 * i, shape=shape) for i in range(500))
    urdf = f'<robot name="many"><link name="base">{parts}</link></robot>'
    assert len(urdf) > 8191  # the engine cuts longer lines
    assert "\n" not in urdf
    bullet = Client(import_pybullet())
    try:
        body = load_urdf(bullet, urdf, ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), 0)
        assert len(bullet.getCollisionShapeData(body, -1)) == 500
        low, high = bullet.getAABB(body, -1)
        assert low[0] < 0.01
        assert high[0] > 4.98
    finally:
        bullet.disconnect()


def test_a_robot_that_the_engine_cannot_load_is_told_with_another_engine(
    experiment: Experiment, monkeypatch: Patch
) -> None:
    def load_nothing(bullet: Any, urdf: str, frame: Any, flags: int) -> int:
        return int(bullet.loadURDF("/no/such/file.urdf", *frame))

    monkeypatch.setattr("evoros.simulator.engines.pybullet_bodies.load_urdf", load_nothing)
    assert_mujoco_opens_what_is_refused(experiment, r"robot erle_rover \(Cannot load URDF file.\)")


def test_a_world_that_the_engine_cannot_build_is_told_with_another_engine(
    experiment: Experiment, monkeypatch: Patch
) -> None:
    def add_nothing(bullet: Any, body: Body) -> list[int]:
        return [bullet.loadURDF("/no/such/file.urdf")]

    monkeypatch.setattr("evoros.simulator.engines.pybullet_bodies.add_body", add_nothing)
    assert_mujoco_opens_what_is_refused(experiment, r"the world 'boxes' \(")


def assert_mujoco_opens_what_is_refused(experiment: Experiment, said: str) -> None:
    def open_in(simulator: Simulator) -> None:
        with open_alone(simulator.open, experiment.robot, experiment.world["boxes"]):
            pass

    with pytest.raises(SimulationError, match=said) as refused:
        open_in(PyBullet())
    assert is_of(str(refused.value), "evoros/simulator/engines/pybullet_model.py simulator=mujoco")
    open_in(Mujoco())
