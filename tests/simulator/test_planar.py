"""The planar simulator drives and stops as geometry says: arcs, lags, limits, contacts."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from planar_cases import (
    angles,
    calm,
    experiment,
    project_obstacles,
    put,
    rover,
    speeds,
    start,
    state_of,
    steerings,
    world_of,
)

from evoros.base.arrays import CONTACT, SPEED, YAW, YAW_RATE, Array, X, Y
from evoros.compilation.rules import ADVANCE, compile_rule
from evoros.geometry.clearance import compute_clearances
from evoros.geometry.shapes import Pose, Shape
from evoros.simulator.engines.planar_rules import advance
from evoros.simulator.planar import Planar


@calm
@given(speeds, steerings, st.integers(1, 20), angles)
def test_the_turning_point_drives_along_a_circle(
    speed: float, steering: float, ticks: int, yaw: float
) -> None:
    drive = experiment().robot.drive
    simulation = start(world_of(), pose=(1.0, 2.0, yaw))
    for _ in range(ticks):
        simulation.advance(np.array([speed, steering]), 0.1)
    state = state_of(simulation)
    steering = min(max(steering, -drive.steering_limit), drive.steering_limit)
    curvature = math.tan(steering) / drive.wheelbase_m
    turn, axle = speed * curvature * 0.1 * ticks, drive.rear_axle_x_m
    # In the frame of the turning point at its start: along (sin, 1 - cos) of the turn, by radius.
    along = math.sin(turn) / curvature if abs(curvature) > 1e-6 else speed * 0.1 * ticks
    aside = (1.0 - math.cos(turn)) / curvature if abs(curvature) > 1e-6 else 0.0
    x = 1.0 + axle * math.cos(yaw) + along * math.cos(yaw) - aside * math.sin(yaw)
    y = 2.0 + axle * math.sin(yaw) + along * math.sin(yaw) + aside * math.cos(yaw)
    final = yaw + turn
    assert state[X] == pytest.approx(x - axle * math.cos(final), abs=1e-6)
    assert state[Y] == pytest.approx(y - axle * math.sin(final), abs=1e-6)
    assert math.cos(state[YAW] - final) == pytest.approx(1.0, abs=1e-12)
    assert abs(state[YAW]) <= math.pi + 1e-12
    assert state[SPEED] == speed
    assert state[YAW_RATE] == pytest.approx(speed * curvature)


def test_arcs_do_not_depend_on_the_step() -> None:
    """Without lags every step is exact, however long."""
    ends = []
    for step in (0.1, 0.02, 0.005):
        simulation = start(world_of(), simulator=Planar(step, 0.0, 0.0))
        for tick in range(50):
            simulation.advance(np.array([0.3, 0.5 * math.sin(tick)]), 0.1)
        ends.append(state_of(simulation))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-12)
    np.testing.assert_allclose(ends[0], ends[2], atol=1e-12)


@pytest.mark.parametrize("lags", [(0.05, 0.0), (0.2, 0.1)])
def test_a_third_of_the_step_makes_a_seventh_of_the_error(lags: tuple[float, float]) -> None:
    """The motion is second order in the step: its error falls ninefold, not threefold."""
    low, high = (0.1, -0.6), (0.5, 0.6)
    courses = np.random.default_rng(5).uniform(low, high, (4, 20, 2))

    def drive(step: float) -> Array:
        ends = []
        for commands in courses:
            simulation = start(world_of(), simulator=Planar(step, *lags))
            for command in commands:
                simulation.advance(command, 0.1)
            ends.append(state_of(simulation)[:2])
        return np.array(ends)

    exact = drive(0.1 / 90)
    # The errors of one course may cancel at one step; those of several do not.
    coarse, fine = (np.abs(drive(step) - exact).sum() for step in (0.1 / 10, 0.1 / 30))
    assert fine < coarse / 7.0


def test_lags_are_of_first_order() -> None:
    """After one time constant, and after two: 1 - 1/e and 1 - 1/e^2 of the way."""
    drive = experiment().robot.drive
    simulation = start(world_of(), simulator=Planar(0.02, 0.1, 0.2))
    command = np.array([0.3, 0.4])
    for steering, speed in ((1, 0.5), (2, 1.0)):
        simulation.advance(command, 0.1)
        state = state_of(simulation)
        angle = 0.4 * -math.expm1(-steering)
        assert state[SPEED] == pytest.approx(0.3 * -math.expm1(-speed))
        expected = state[SPEED] * math.tan(angle) / drive.wheelbase_m
        assert state[YAW_RATE] == pytest.approx(expected)


def test_the_drive_is_limited() -> None:
    drive = experiment().robot.drive
    simulation = start(world_of())
    simulation.advance(np.array([9.0, 9.0]), 0.1)
    state = state_of(simulation)
    assert state[SPEED] == drive.max_speed_mps
    lock = math.tan(drive.steering_limit) / drive.wheelbase_m
    assert state[YAW_RATE] == pytest.approx(drive.max_speed_mps * lock)


@pytest.mark.slow
@calm
@given(st.floats(0.3, 1.0), st.floats(-0.5, 0.5), st.sampled_from([0.005, 0.02, 0.05]))
def test_it_stops_at_a_wall_and_says_so(gap: float, tilt: float, step: float) -> None:
    """Closer than one step to it, and never beyond."""
    robot = rover()
    front = float(robot.outline[:, 0].max())
    wall = Shape("box", (0.2, 9.0, 0.5)), Pose((front + gap + 0.1, 0.0, 0.25))
    world = world_of(wall)
    simulation = start(world, robot, simulator=Planar(step, 0.0, 0.0))
    touched = []
    for _ in range(round((gap + 0.5) / 0.03)):
        simulation.advance(np.array([0.3, 0.0]), 0.1)
        touched.append(bool(state_of(simulation)[CONTACT]))
    state = state_of(simulation)
    first = touched.index(True)
    assert all(touched[first:])
    assert not any(touched[:first])
    left = front + gap - (state[X] + front)
    assert 0.0 <= left < 0.3 * step + 1e-9
    assert state[SPEED] == 0.0


def test_what_is_higher_than_the_robot_is_no_obstacle_to_it() -> None:
    robot = rover()
    for height, touched in ((robot.height_m - 0.01, True), (robot.height_m + 0.01, False)):
        beam = Shape("box", (0.2, 9.0, 0.1)), Pose((1.0, 0.0, height + 0.05))
        simulation = start(world_of(beam), robot)
        simulation.advance(np.array([0.39, 0.0]), 5.0)
        assert bool(state_of(simulation)[CONTACT]) is touched


def test_contact_is_that_of_the_outlines() -> None:
    """At random poses in a random field: contact where the clearance is 0."""
    rng = np.random.default_rng(3)
    field = [
        (Shape("box", (0.4, 0.6, 0.3)), Pose.from_rpy((x, y, 0.1), 0.3, 0.2, angle))
        for x, y, angle in rng.uniform(-4, 4, (40, 3))
    ]
    robot, world = rover(), world_of(*field)
    poses = rng.uniform((-4, -4, -3), (4, 4, 3), (400, 3))
    below = project_obstacles(world, robot)
    expected = compute_clearances(robot.outline, poses, below) == 0.0
    assert 50 < expected.sum() < 350
    simulation = start(world, robot)
    for pose, touches in zip(poses, expected, strict=True):
        put(simulation, *pose)
        simulation.advance(np.zeros(2), 0.02)
        assert bool(state_of(simulation)[CONTACT]) == touches


def test_a_robot_that_reaches_farther_than_it_sees_meets_obstacles() -> None:
    bare = experiment().robot.with_sensors([], {})
    robot = replace(bare, outline=4.0 * bare.outline)
    post = Shape("box", (0.2, 0.2, 0.5)), Pose((4.0, 0.0, 0.25))
    simulation = start(world_of(post), robot)
    simulation.advance(np.array([0.3, 0.0]), 20.0)
    state = state_of(simulation)
    assert state[CONTACT] == 1.0
    assert 3.9 - 0.3 * 0.02 <= state[X] + robot.outline[:, 0].max() <= 3.9


@pytest.mark.parametrize("compiling", [True, False])
@pytest.mark.parametrize("command", [(math.nan, 0.1), (0.3, math.nan)])
def test_a_command_that_is_no_number_loses_the_state(
    compiling: bool, command: tuple[float, float]
) -> None:
    """Which ends the mission as a failure, compiled or not; it is no error of Python's."""
    post = Shape("box", (0.2, 0.2, 0.5)), Pose((4.0, 0.0, 0.25))
    simulation = start(world_of(post), rover((0.2, 0.0, 0.166, 0.0, 12.5)))
    drive = compile_rule(advance, ADVANCE) if compiling else advance
    drive(simulation.parameters, simulation.memory, np.array(command), 0.1)
    simulation.sense(np.zeros(1))
    assert not np.isfinite(state_of(simulation)[[X, Y, YAW, SPEED]]).all()


def test_foundations_below_the_ground_are_no_obstacle() -> None:
    """Wholly below it; what stands out by a centimetre is one."""
    for depth, touched in ((0.30, False), (0.29, True)):
        slab = Shape("box", (0.2, 9.0, 0.3)), Pose((1.0, 0.0, 0.15 - depth))
        simulation = start(world_of(slab))
        simulation.advance(np.array([0.39, 0.0]), 5.0)
        assert bool(state_of(simulation)[CONTACT]) is touched
