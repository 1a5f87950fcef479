"""A robot whose body's mesh is missing meets a post between its wheels, in every engine."""

from pathlib import Path

import numpy as np
import pytest
from pybullet_cases import level, short_experiment
from rigid_cases import ENGINES, Rigid

from evoros.base.arrays import CONTACT, STATE_SIZE, X
from evoros.drive.automatic import AutomaticDescription
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.robot.loading import load_robot
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import open_alone

pytestmark = pytest.mark.usefixtures("closed_engines")

INERTIAL = """<inertial><mass value="{0}"/>
  <inertia ixx="{1}" iyy="{1}" izz="{1}" ixy="0" ixz="0" iyz="0"/></inertial>"""
WHEEL = """<link name="{0}_wheel">{1}<collision><origin rpy="1.5707963 0 0"/>
    <geometry><cylinder radius="0.05" length="0.03"/></geometry></collision></link>
  <joint name="{0}_joint" type="continuous"><parent link="body"/><child link="{0}_wheel"/>
    <origin xyz="0 {2} 0.05"/><axis xyz="0 1 0"/><limit effort="2" velocity="10"/></joint>"""
BALL = """<link name="{0}_caster">{1}<collision><geometry><sphere radius="0.02"/></geometry>
    </collision></link>
  <joint name="{0}_joint" type="fixed"><parent link="body"/><child link="{0}_caster"/>
    <origin xyz="{2} 0.1 0.02"/></joint>"""
LOST = f"""<robot name="lost"><link name="body"><collision><geometry>
    <mesh filename="package://lost/body.dae"/></geometry></collision></link>
  <link name="mass">{INERTIAL.format(4.0, 0.04)}</link>
  <joint name="mass_joint" type="fixed"><parent link="body"/><child link="mass"/>
    <origin xyz="0 0 0.06"/></joint>
  {WHEEL.format("left", INERTIAL.format(0.3, 0.0005), 0.15)}
  {WHEEL.format("right", INERTIAL.format(0.3, 0.0005), -0.15)}
  {BALL.format("front", INERTIAL.format(0.1, 0.0001), 0.14)}
  {BALL.format("rear", INERTIAL.format(0.1, 0.0001), -0.14)}</robot>"""


@pytest.mark.parametrize("kind", [Planar, *ENGINES])
def test_a_post_between_the_wheels_stops_it(kind: type[Planar | Rigid], tmp_path: Path) -> None:
    """The box around wheels and casters reaches 0.16 m ahead, and the post begins at 0.48 m."""
    file = tmp_path / "lost.urdf"
    file.write_text(LOST)
    robot = load_robot(str(file), AutomaticDescription(), missing="box")
    post = Body("post", Pose((0.5, 0.0, 0.5)), (Shape("box", (0.04, 0.04, 1.0)),))
    state, places = np.zeros(STATE_SIZE), []
    with open_alone(
        kind(time_step=0.005).open, robot, level(short_experiment(), post)
    ) as simulation:
        for _ in range(40):
            simulation.advance(np.array([0.3, 0.0]), 0.1)
            simulation.observe(state)
            places.append((float(state[X]), bool(state[CONTACT])))
    first = next(x for x, contact in places if contact)
    assert first == pytest.approx(0.32, abs=0.035)
    assert places[-1][0] < 0.36
