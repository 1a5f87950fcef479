"""Robots whose wheels stick out, whose mesh is missing or whose motors have no limits drive."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drive_cases import FRONT, PAIR, REAR, Y, steered
from pybullet_cases import level, short_experiment
from rigid_cases import ENGINES, Rigid, probe

from evoros.base.arrays import CONTACT, SPEED, STATE_SIZE, X
from evoros.drive.automatic import AutomaticDescription
from evoros.drive.differential import DifferentialDescription
from evoros.formats.urdf.tree import UrdfDocument
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.robot.loading import load_robot
from evoros.robot.model import Robot
from evoros.robot.mounting import MountDefaults
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import Simulator, open_alone
from evoros.world.model import World

pytestmark = pytest.mark.usefixtures("closed_engines")


def link(name: str, mass: float, shape: str, origin: str = "0 0 0", turn: str = "0 0 0") -> str:
    moment = f"{0.01 * mass}"
    return f"""<link name="{name}">
      <inertial><origin xyz="{origin}"/><mass value="{mass}"/>
        <inertia ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/></inertial>
      <collision><origin xyz="{origin}" rpy="{turn}"/><geometry>{shape}</geometry></collision>
    </link>"""


def joint(name: str, child: str, origin: str, kind: str = "continuous") -> str:
    return f"""<joint name="{name}" type="{kind}"><parent link="base"/><child link="{child}"/>
      <origin xyz="{origin}"/><axis xyz="0 1 0"/><limit effort="5" velocity="20"/></joint>"""


WHEEL = link("{}", 0.5, '<cylinder radius="0.1" length="0.04"/>', turn="1.5707963267948966 0 0")
CHASSIS = '<box size="0.3 0.2 0.1"/>'
BUGGY = f"""<robot name="buggy">
  {link("base", 4.0, CHASSIS, "-0.1 0 0.12")}
  {WHEEL.format("left")}{WHEEL.format("right")}
  {link("caster", 0.2, '<sphere radius="0.04"/>')}
  {joint("left_joint", "left", "0 0.2 0.1")}{joint("right_joint", "right", "0 -0.2 0.1")}
  {joint("caster_joint", "caster", "-0.22 0 0.04", "fixed")}
  {joint("flap_joint", "flap", "-0.2 0 0.3")}
  {link("flap", 0.3, '<box size="0.2 0.02 0.02"/>', "0.1 0 0")}
</robot>
"""


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> Any:
    return request.param


@cache
def experiment_world() -> World:
    return level(short_experiment())


@pytest.fixture(scope="module")
def buggy(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """Its wheels reach 0.1 m ahead of the chassis, which ends 0.05 m ahead of the axle."""
    file = tmp_path_factory.mktemp("robot") / "buggy.urdf"
    file.write_text(BUGGY)
    drive = DifferentialDescription(["left_joint", "right_joint"], ["caster"], 0.3, 0.9, 0.5)
    robot = load_robot(str(file), drive, MountDefaults("base", 0.2, 0.0))
    corners = [[-0.25, -0.22], [0.1, -0.22], [0.1, 0.22], [-0.25, 0.22]]
    wheels = frozenset({"left", "right"})
    return replace(robot, outline=np.array(corners), exposed_links=wheels)


def world_with(*bodies: Body) -> World:
    return replace(experiment_world(), bodies=(*experiment_world().bodies, *bodies))


def drive_on(robot: Robot, world: World, simulator: Planar | Rigid) -> list[tuple[float, bool]]:
    state, seen = np.zeros(STATE_SIZE), []
    with open_alone(simulator.open, robot, world) as simulation:
        for _ in range(40):
            simulation.advance(np.array([0.3, 0.0]), 0.1)
            simulation.observe(state)
            seen.append((float(state[X]), bool(state[CONTACT])))
    return seen


@pytest.mark.parametrize("kind", [Planar, *ENGINES])
@pytest.mark.parametrize("mass", [None, 500.0])
def test_a_wheel_meets_a_post(buggy: Robot, kind: type[Planar | Rigid], mass: float | None) -> None:
    """A post of 0.6 m ahead of the left wheel, which the chassis would pass."""
    shape = (Shape("box", (0.1, 0.1, 1.0)),)
    post = Body("post", Pose((0.65, 0.2, 0.5)), shape, mass)
    seen = drive_on(buggy, world_with(post), kind(time_step=0.005))
    first = next(x for x, contact in seen if contact)
    assert first == pytest.approx(0.5, abs=0.035)
    assert not seen[0][1]


def test_covered_wheels_pass_through_posts(engine: type[Rigid], buggy: Robot) -> None:
    """Without the name of a link it is in no list of what obstacles touch."""
    post = Body("post", Pose((0.65, 0.2, 0.5)), (Shape("box", (0.1, 0.1, 1.0)),))
    covered = replace(buggy, exposed_links=frozenset())
    seen = drive_on(covered, world_with(post), engine())
    assert not any(contact for _, contact in seen)
    assert seen[-1][0] > 0.9


def test_wheels_roll_on_a_floor_made_of_a_body(engine: type[Rigid], buggy: Robot) -> None:
    """A slab of 20 m whose top is at 0: no contact is reported, and the robot drives."""
    slab = Body("slab", Pose((0.0, 0.0, -0.5)), (Shape("box", (20.0, 20.0, 1.0)),), floor=True)
    world = replace(experiment_world(), bodies=(slab,))
    seen = drive_on(buggy, world, engine())
    assert not any(contact for _, contact in seen)
    assert seen[-1][0] == pytest.approx(1.2, abs=0.05)


def test_a_joint_that_nothing_drives_turns_freely(engine: type[Rigid], buggy: Robot) -> None:
    """A flap of 0.2 m, let go level: the engine's own motor would hold it there.

    The engine gets the description of the file, in which the joint is not held yet.
    """
    described = replace(buggy, engine_urdf=None)
    with open_alone(engine().open, described, world_with()) as simulation:
        simulation.advance(np.zeros(2), 0.2)
        assert probe(simulation).angle("flap_joint") > 0.3


def test_a_chassis_may_be_a_polyhedron(engine: type[Rigid], buggy: Robot) -> None:
    """The corners of its box, in the element that stands for a mesh: the wall is met as before."""
    corners = " ".join(
        f"{x} {y} {z}" for x in (-0.15, 0.15) for y in (-0.1, 0.1) for z in (-0.05, 0.05)
    )
    text = buggy.base_urdf.text.replace(CHASSIS, f'<convex corners="{corners}"/>')
    assert "<convex" in text
    robot = replace(buggy, base_urdf=UrdfDocument(text), exposed_links=frozenset())
    wall = Body("wall", Pose((0.65, 0.0, 0.5)), (Shape("box", (0.1, 0.1, 1.0)),))
    seen = drive_on(robot, world_with(wall), engine(time_step=0.005))
    assert next(x for x, contact in seen if contact) == pytest.approx(0.55, abs=0.035)


INERTIAL = """<inertial><mass value="{0}"/>
  <inertia ixx="{1}" iyy="{1}" izz="{1}" ixy="0" ixz="0" iyz="0"/></inertial>"""
HEAVY_WHEEL = """<link name="{0}_wheel">{1}<collision><origin rpy="1.5707963 0 0"/>
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
  {HEAVY_WHEEL.format("left", INERTIAL.format(0.3, 0.0005), 0.15)}
  {HEAVY_WHEEL.format("right", INERTIAL.format(0.3, 0.0005), -0.15)}
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


DRIVES = {"differential": PAIR, "skid_steer": FRONT + REAR, "ackermann": None}
UNLIMITED = {"none": "", "-1": 'effort="-1" velocity="-1"', "0": 'effort="0" velocity="0"'}
BODY = """<link name="base"><inertial><origin xyz="0 0 0.05"/><mass value="4"/><inertia ixx="0.05"
iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial><collision><origin xyz="0 0 0.06"/>
<geometry><box size="0.5 0.15 0.06"/></geometry></collision></link>"""


@pytest.mark.parametrize("simulator", ENGINES)
@pytest.mark.parametrize(
    ("limit", "kind"),
    [*(("none", kind) for kind in DRIVES), ("-1", "ackermann"), ("0", "differential")],
)
def test_wheels_without_limits_turn_as_commanded(
    simulator: type[Simulator], limit: str, kind: str, tmp_path: Path
) -> None:
    """PyBullet's wheels that skid are prisms in a margin of 1 mm, of 2 % of the radius."""
    stated = UNLIMITED[limit]
    steering = steered("revolute", f'<limit lower="-0.6" upper="0.6" {stated}/>')
    parts = (DRIVES[kind] or steering + REAR).replace(Y, f"{Y}<limit {stated}/>" if stated else Y)
    (tmp_path / "r.urdf").write_text(f'<robot name="r">{BODY}{parts}</robot>')
    robot = load_robot(str(tmp_path / "r.urdf"), AutomaticDescription())
    speed, state = 0.9 * robot.drive.max_speed_mps, np.zeros(STATE_SIZE)
    with open_alone(simulator().open, robot, level(short_experiment())) as simulation:
        simulation.advance(np.array([speed, 0.0]), 2.0)
        simulation.observe(state)
    assert state[SPEED] == pytest.approx(speed, rel=0.03)
