"""A small, light robot: PyBullet's default step is reported as too coarse, MuJoCo's is not."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from evoros.base.arrays import SPEED, STATE_SIZE, YAW, Array, X, Y
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.preflight.drive import check_drive
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.protocol import open_alone
from evoros.simulator.pybullet import PyBullet
from evoros.world.floors import GROUND

pytestmark = pytest.mark.usefixtures("closed_engines")


def link(name: str, mass: float, shape: str, moment: float, turn: str = "0 0 0") -> str:
    return f"""<link name="{name}"><inertial><mass value="{mass}"/>
      <inertia ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/></inertial>
      <collision><origin rpy="{turn}"/><geometry>{shape}</geometry></collision></link>"""


def wheel(side: str, y: float) -> str:
    rim = '<cylinder radius="0.033" length="0.025"/>'
    return f"""{link(side, 0.032, rim, 2e-5, "1.5707963267948966 0 0")}
      <joint name="{side}_joint" type="continuous"><parent link="base"/><child link="{side}"/>
      <origin xyz="0.03 {y} 0.033"/><axis xyz="0 1 0"/></joint>"""


# The measures of the Andino: wheels of 33 mm, 135 mm apart, a plate of 0.8 kg, and a heavy caster.
SMALL = f"""<robot name="small">
  {link("base", 0.02, '<box size="0.01 0.01 0.01"/>', 1e-6).replace("<origin rpy", '<origin xyz="0 0 0.1" rpy')}
  {link("plate", 0.8, '<box size="0.195 0.08 0.005"/>', 0.0025)}
  <joint name="plate_joint" type="fixed"><parent link="base"/><child link="plate"/>
    <origin xyz="0 0 0.055"/></joint>
  {wheel("left", 0.0675)}{wheel("right", -0.0675)}
  {link("caster", 0.5, '<sphere radius="0.015"/>', 4e-5)}
  <joint name="caster_joint" type="fixed"><parent link="base"/><child link="caster"/>
    <origin xyz="-0.075 0 0.015"/></joint>
</robot>
"""  # noqa: E501


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    file = tmp_path_factory.mktemp("robot") / "small.urdf"
    file.write_text(SMALL)
    overrides = ["robot=own", f"robot.description={file}", "design=around", "simulator=planar"]
    return compose(overrides).build()


def drive(simulator: Mujoco | PyBullet, small: Experiment, *commands: float) -> Array:
    """Two seconds of run-up with a command, then the states every 0.1 s for two more."""
    course = replace(small.world["boxes"].course, home_x_m=0.0, home_y_m=0.0, home_yaw_rad=0.0)
    world = replace(small.world["boxes"], bodies=(GROUND,), course=course)
    states = np.zeros((21, STATE_SIZE))
    with open_alone(simulator.open, small.robot, world) as simulation:
        simulation.advance(np.array(commands), 2.0)
        for state in states:
            simulation.observe(state)
            simulation.advance(np.array(commands), 0.1)
    states[:, YAW] = np.unwrap(states[:, YAW])
    return states


def test_mujoco_drives_it_as_commanded_at_the_default_step(small: Experiment) -> None:
    rest = drive(Mujoco(), small, 0.0, 0.0)
    assert np.ptp(rest[:, [X, Y]], axis=0).max() < 1e-4
    straight = drive(Mujoco(), small, 0.2, 0.0)
    assert straight[:, SPEED].mean() == pytest.approx(0.2, rel=0.005)
    for steering in (0.4, -0.9):
        turned = drive(Mujoco(), small, 0.2, steering)[:, YAW]
        rate = 0.2 * math.tan(steering) / small.robot.drive.wheelbase_m
        assert (turned[-1] - turned[0]) / 2.0 == pytest.approx(rate, rel=0.05)


def test_pybullet_at_the_default_step_is_reported_with_one_that_does(small: Experiment) -> None:
    (line,) = check_drive(replace(small, simulator=PyBullet()))
    advice = re.search(r"set simulator\.time_step=(\S+) simulator\.solver_iterations=(\d+),", line)
    assert advice is not None, line
    finer = PyBullet(time_step=float(advice[1]), solver_iterations=int(advice[2]))
    assert list(check_drive(replace(small, simulator=finer))) == []
    assert list(check_drive(replace(small, simulator=Mujoco()))) == []
