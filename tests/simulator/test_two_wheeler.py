"""Robots with differential drive and skid-steer in all simulators, against geometry and moments."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree
from planar_cases import state_of
from pybullet_cases import level, short_experiment
from rigid_cases import ENGINES, Rigid, attitude

from evoros.base.arrays import CONTACT, SPEED, STATE_SIZE, YAW, YAW_RATE, X, Y
from evoros.config.compose import compose
from evoros.drive.automatic import AutomaticDescription
from evoros.drive.skid_steer import SkidSteer
from evoros.evolution.experiment import Experiment
from evoros.formats.urdf.tree import read_tree
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.mission.mission import Mission
from evoros.mission.rollout import run_mission
from evoros.robot.loading import load_robot
from evoros.robot.model import Robot
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import Simulator, open_alone
from evoros.simulator.pybullet import PyBullet
from evoros.world.model import World

pytestmark = pytest.mark.usefixtures("closed_engines")

SIMULATORS: dict[str, tuple[Any, float]] = {
    "pybullet": (PyBullet(), 0.01),
    "mujoco": (Mujoco(), 0.01),
    "planar": (Planar(), 1e-9),
}
"""Each at its default step, and how far it may be from the geometry."""


@cache
def experiment(*overrides: str) -> Experiment:
    return compose(["robot=two_wheeler", *overrides]).build()


def robot() -> Robot:
    return experiment().robot


def plain(*bodies: Body) -> World:
    """Level ground with these bodies."""
    world = experiment().world["boxes"]
    ground = tuple(body for body in world.bodies if body.is_ground)
    course = replace(world.course, home_x_m=0.0, home_y_m=0.0, home_z_m=0.0, home_yaw_rad=0.0)
    return replace(world, bodies=(*ground, *bodies), course=course)


# Open loop.

COMMANDS = [(0.29, 0.1), (0.29, -0.3), (0.29, 0.6), (0.05, 0.9), (0.4, -0.9), (-0.29, 0.6), (9, 9)]


def wanted(speed: float, steering: float) -> tuple[float, float]:
    """Speed [m/s] and curvature [1/m] by the limits in the robot's YAML and the track in its file:
    0.45 m/s of a wheel, 0.9 rad, 0.29 m.
    """
    curvature = math.tan(min(max(steering, -0.9), 0.9)) / 0.3
    fastest = 0.45 / (1.0 + 0.145 * abs(curvature))
    return min(max(speed, -fastest), fastest), curvature


@pytest.mark.parametrize("simulator", SIMULATORS)
@pytest.mark.parametrize("command", COMMANDS)
def test_speed_turning_rate_and_radius_are_those_of_the_geometry(
    simulator: str, command: tuple[float, float]
) -> None:
    engine, tolerance = SIMULATORS[simulator]
    speed, curvature = wanted(*command)
    rows = []
    with open_alone(engine.open, robot(), plain()) as simulation:
        simulation.advance(np.array(command), 1.0)
        for _ in range(100):
            rows.append(state_of(simulation))
            simulation.advance(np.array(command), 0.1)
    path = np.array(rows)
    yaw = np.unwrap(path[:, YAW])
    axle = path[:, [X, Y]] - 0.1 * np.column_stack([np.cos(yaw), np.sin(yaw)])
    chords = np.sqrt((np.diff(axle, axis=0) ** 2).sum(axis=1))
    half = 0.5 * speed * curvature * 0.1
    assert chords.sum() / 9.9 == pytest.approx(abs(speed) * math.sin(half) / half, rel=tolerance)
    assert (yaw[-1] - yaw[0]) / 9.9 == pytest.approx(speed * curvature, rel=tolerance)
    assert path[:, SPEED] == pytest.approx(speed, rel=3 * tolerance)
    assert path[:, YAW_RATE] == pytest.approx(speed * curvature, rel=3 * tolerance)
    left = np.column_stack([-np.sin(yaw), np.cos(yaw)])
    assert np.ptp(axle + left / curvature, axis=0).max() < 0.04 * abs(1 / curvature)
    assert not path[:, CONTACT].any()


@pytest.mark.parametrize("simulator", SIMULATORS)
@pytest.mark.parametrize("speed", [0.29, -0.29, 9.0])
def test_straight_ahead_it_does_not_drift(simulator: str, speed: float) -> None:
    engine, tolerance = SIMULATORS[simulator]
    with open_alone(engine.open, robot(), plain()) as simulation:
        simulation.advance(np.array([speed, 0.0]), 1.0)
        start = state_of(simulation)
        simulation.advance(np.array([speed, 0.0]), 10.0)
        x, y, yaw = (state_of(simulation) - start)[[X, Y, YAW]]
    assert x == pytest.approx(10.0 * wanted(speed, 0.0)[0], rel=tolerance)
    assert abs(y) < tolerance * abs(x)
    assert abs(yaw) < tolerance


# What only a rigid body can do wrong.


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> Any:
    return request.param


def test_at_rest_it_stands_level_where_it_was_put(engine: type[Rigid]) -> None:
    with open_alone(engine().open, robot(), plain()) as simulation:
        simulation.advance(np.zeros(2), 10.0)
        assert attitude(simulation) == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
        assert state_of(simulation) == pytest.approx(np.zeros(STATE_SIZE), abs=5e-3)


def test_it_neither_tips_nor_sinks_at_the_hardest_manoeuvres(engine: type[Rigid]) -> None:
    rows = []
    with open_alone(engine().open, robot(), plain()) as simulation:
        for tick in range(100):
            forward = 1.0 if tick // 5 % 2 else -1.0
            turned = 0.9 if tick // 7 % 2 else -0.9
            simulation.advance(np.array([0.45 * forward, turned * (tick < 60)]), 0.1)
            rows.append(attitude(simulation))
    height, roll, pitch = np.abs(rows).max(axis=0)
    assert height < 1e-3
    assert max(roll, pitch) < 0.5


@pytest.mark.parametrize("name", ["two_wheeler", "erle_rover"])
def test_wheels_and_casters_meet_nothing_but_the_ground(engine: type[Rigid], name: str) -> None:
    """A wide sill far below the chassis: they pass through it, which would tilt them by 1 deg."""
    driven = experiment(f"robot={name}").robot
    sill = Body("sill", Pose((0.7, 0.0, 0.0025)), (Shape("box", (0.5, 2.0, 0.005)),))
    with open_alone(engine().open, driven, plain(sill)) as simulation:
        for _ in range(40):
            simulation.advance(np.array([0.3, 0.0]), 0.1)
            assert attitude(simulation) == pytest.approx((0.0, 0.0, 0.0), abs=0.02)
        assert state_of(simulation)[X] > 1.1


# As a part.


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_it_runs_missions_with_the_sensors_of_the_rover(simulator: str) -> None:
    limits = [f"world.{name}.course.time_limit_s=20" for name in ("boxes", "maze", "blocks")]
    whole = experiment(f"simulator={simulator}", *limits)
    design = whole.space.decode(np.full(whole.space.size, 0.5))
    (outcome,), track = run_mission(
        whole.scenario, Mission(0, 0, design, "blocks", 0, "evaluation", "test")
    )
    assert len(design.mounts) == 6
    assert outcome.ended == "time_limit"
    assert 4.0 < outcome.distance_m < 6.5  # 0.29 m/s for 20 s, weaving
    assert np.isfinite(track).all()


def test_wheels_and_caster_are_within_the_outline_and_no_part_of_it() -> None:
    outline = robot().outline
    assert outline.min(axis=0) == pytest.approx([-0.175, -0.165])
    assert outline.max(axis=0) == pytest.approx([0.245, 0.165])
    assert robot().height_m == pytest.approx(0.15)
    links = read_tree(etree.fromstring(robot().urdf.encode()), "robot").poses
    for link, radius, half in (("left_wheel", 0.06, 0.015), ("caster", 0.03, 0.03)):
        x, y, _ = links[link].position
        assert -0.175 < x - radius < x + radius < 0.245
        assert abs(y) + half < 0.165
    assert not robot().exposed_links
    far = experiment("+robot.arguments.caster_x=0.4").robot
    assert far.exposed_links == {"caster"}
    assert far.outline.max(axis=0) == pytest.approx([0.43, 0.165], rel=2e-3)


def test_wheels_that_are_cylinders_roll_as_far_as_their_radius_says(engine: type[Rigid]) -> None:
    driven = experiment("+robot.arguments.wheel_collision=cylinder").robot
    with open_alone(engine(time_step=0.01).open, driven, plain()) as simulation:
        simulation.advance(np.array([0.3, 0.0]), 1.0)
        start = state_of(simulation)
        simulation.advance(np.array([0.3, 0.0]), 2.0)
        end = state_of(simulation)
    assert end[X] - start[X] == pytest.approx(0.6, rel=0.005)
    assert abs(end[YAW]) < math.radians(0.5)


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
