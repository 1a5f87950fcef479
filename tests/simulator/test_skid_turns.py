"""A robot with skid-steer: the plane turns as stated, the rigid body nearly as computed."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pybullet_cases import level, short_experiment

from evoros.base.arrays import SPEED, STATE_SIZE, YAW, X
from evoros.drive.automatic import AutomaticDescription
from evoros.drive.skid_steer import SkidSteer
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.robot.loading import load_robot
from evoros.robot.model import Robot
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import Simulator, open_alone
from evoros.simulator.pybullet import PyBullet
from evoros.world.model import World

pytestmark = pytest.mark.usefixtures("closed_engines")

INERTIAL = """<inertial><mass value="{0}"/><inertia ixx="{1}" iyy="{1}" izz="{1}" ixy="0" ixz="0"
 iyz="0"/></inertial>"""
WHEEL = f"""<link name="{{0}}">{INERTIAL.format(1.0, 0.005)}<collision><geometry>
<sphere radius="0.1"/></geometry></collision></link>
<joint name="{{0}}_joint" type="continuous"><parent link="base"/><child link="{{0}}"/>
<origin xyz="{{1}} {{2}} 0"/><axis xyz="0 1 0"/><limit effort="20" velocity="20"/></joint>"""


def load(folder: Path, **drive: Any) -> Robot:
    places = (("fl", 0.15, 0.2), ("fr", 0.15, -0.2), ("rl", -0.15, 0.2), ("rr", -0.15, -0.2))
    wheels = "".join(WHEEL.format(*place) for place in places)
    body = '<collision><geometry><box size="0.3 0.3 0.1"/></geometry></collision>'
    base = f'<link name="base">{body}{INERTIAL.format(8.0, 0.1)}</link>'
    (folder / "skid.urdf").write_text(f'<robot name="skid">{base}{wheels}</robot>')
    return load_robot(str(folder / "skid.urdf"), AutomaticDescription(max_speed_mps=1.0, **drive))


@cache
def flat() -> World:
    return level(short_experiment())


def turn(simulator: Simulator, robot: Robot, speed: float = 0.3, radius: float = 1.0) -> float:
    """How far the robot turns in a commanded turn, as a share of what is commanded."""
    steering = math.atan(robot.drive.wheelbase_m / radius)
    command, state, yaws = np.array([speed, steering]), np.zeros(STATE_SIZE), []
    with open_alone(simulator.open, robot, flat()) as simulation:
        simulation.advance(command, 2.0)
        for _ in range(41):
            simulation.observe(state)
            yaws.append(state[YAW])
            simulation.advance(command, 0.1)
    return float(np.ptp(np.unwrap(yaws))) / (4.0 * speed / radius)


@pytest.mark.parametrize(("multiplier", "ratio"), [(None, 1.0), (1.0, 0.64), (2.0, 1.28)])
def test_the_plane_turns_by_the_stated_ratio(
    tmp_path: Path, multiplier: float | None, ratio: float
) -> None:
    keys = {} if multiplier is None else {"wheel_separation_multiplier": multiplier}
    robot = load(tmp_path, **keys)
    assert isinstance(robot.drive, SkidSteer)
    assert robot.drive.turning_resistance == pytest.approx(1.0 + (0.3 / 0.4) ** 2)
    assert robot.drive.turn_ratio == pytest.approx(ratio)
    assert turn(Planar(drive_lag_s=0.0), robot) == pytest.approx(ratio, rel=1e-6)


def test_pybullet_turns_nearly_as_the_balance_of_moments_says(tmp_path: Path) -> None:
    """Only to a quarter: it limits friction in two directions, each by itself.

    A sliding wheel therefore gets up to 1.41 times the force of Coulomb's law, aslant. The result
    is the same at steps from 1.25 to 10 ms. Without the multiplier the robot turns half as far.
    """
    simulator = PyBullet(time_step=0.0025, solver_iterations=100)
    assert turn(simulator, load(tmp_path)) == pytest.approx(1.0, rel=0.25)
    plain = load(tmp_path, wheel_separation_multiplier=1.0)
    assert turn(simulator, plain) == pytest.approx(0.64, rel=0.25)


@pytest.mark.parametrize("step", [0.0025, 0.01, 0.02])
@pytest.mark.parametrize(("speed", "radius"), [(0.1, 1.0), (0.3, 0.5), (0.3, 2.0)])
def test_mujoco_turns_as_the_balance_of_moments_says(
    tmp_path: Path, step: float, speed: float, radius: float
) -> None:
    """With firm friction the robot hops, and turns at 0.5 to 1.3 times that rate."""
    robot = load(tmp_path)
    assert turn(Mujoco(time_step=step), robot, speed, radius) == pytest.approx(1.0, rel=0.025)


def test_a_skid_steer_robot_creeps_on_a_slope_and_starts_late_by_little(tmp_path: Path) -> None:
    """The price of friction that grows with the slip: 2 cm/s at 0.1 rad, 3 cm at 0.3 m/s."""
    robot, state, plane = load(tmp_path), np.zeros(STATE_SIZE), Shape("plane", (0.0, 0.0, 1.0))
    slope = Body("slope", Pose.from_rpy((0.0, 0.0, 0.0), 0.0, -0.1, 0.0), (plane,))
    with open_alone(Mujoco().open, robot, replace(flat(), bodies=(slope,))) as simulation:
        simulation.advance(np.zeros(2), 2.0)
        simulation.observe(state)
    assert -0.04 < state[X] < 0.0
    with open_alone(Mujoco().open, robot, flat()) as simulation:
        simulation.advance(np.array([0.3, 0.0]), 2.0)
        simulation.observe(state)
    assert 0.57 < state[X] < 0.6
    assert state[SPEED] == pytest.approx(0.3, rel=0.005)
