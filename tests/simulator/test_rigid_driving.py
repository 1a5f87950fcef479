"""Both rigid-body engines drive, touch and push as analytic answers say."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drive_cases import HALF_M, vehicle
from pybullet_cases import box, going_on, level
from rigid_cases import ENGINES, STEPS, Rigid, probe

from evoros.base.arrays import CONTACT, SPEED, STATE_SIZE, YAW, X, Y
from evoros.base.errors import InputError
from evoros.drive.automatic import AutomaticDescription
from evoros.evolution.experiment import Experiment
from evoros.robot.loading import load_robot
from evoros.simulator.protocol import open_alone

pytestmark = pytest.mark.usefixtures("closed_engines")


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> Any:
    return request.param


@pytest.mark.parametrize(
    ("front", "rear", "steers"), [(0.1, 0.2, "front"), (0.15, 0.15, "rear"), (0.2, 0.1, "rear")]
)
def test_axles_of_two_radii_and_steered_rear_axles_drive_the_commanded_circle(
    engine: type[Rigid],
    experiment: Experiment,
    front: float,
    rear: float,
    steers: str,
    tmp_path: Path,
) -> None:
    file, state, speed, steering = tmp_path / "r.urdf", np.zeros(STATE_SIZE), 0.3, 0.3
    file.write_text(vehicle(front, rear, steers))
    robot = load_robot(str(file), AutomaticDescription())
    fixed = -HALF_M if steers == "front" else HALF_M
    assert robot.drive.rear_axle_x_m == pytest.approx(fixed)
    with open_alone(engine().open, robot, level(experiment)) as simulation:
        simulation.advance(np.array([speed, 0.0]), 2.0)
        simulation.observe(state)
        start = state[X]
        simulation.advance(np.array([speed, 0.0]), 2.0)
        simulation.observe(state)
        assert state[X] - start == pytest.approx(speed * 2.0, rel=0.02)
        simulation.advance(np.array([speed, steering]), 2.0)
        path = []
        for _ in range(30):
            simulation.advance(np.array([speed, steering]), 0.1)
            simulation.observe(state)
            x, y, yaw = state[X], state[Y], state[YAW]
            path.append([x + fixed * math.cos(yaw), y + fixed * math.sin(yaw), yaw])
    places = np.array(path)
    way = np.sqrt((np.diff(places[:, :2], axis=0) ** 2).sum(axis=1)).sum()
    turned = np.unwrap(places[:, 2])[-1] - places[0, 2]
    assert way == pytest.approx(speed * 2.9, rel=0.03)
    assert way / turned == pytest.approx(2.0 * HALF_M / math.tan(steering), rel=0.05)


@pytest.mark.parametrize("step", STEPS)
def test_turning_radius_and_speed_are_those_of_the_geometry(
    engine: type[Rigid], experiment: Experiment, step: float
) -> None:
    robot, state = experiment.robot, np.zeros(STATE_SIZE)
    with open_alone(engine(time_step=step).open, robot, level(experiment)) as simulation:
        simulation.advance(np.array([0.3, 0.0]), 4.0)
        simulation.observe(state)
        assert state[SPEED] == pytest.approx(0.3, rel=0.02)
        simulation.advance(np.array([0.3, 0.3]), 2.0)
        places = []
        for _ in range(50):
            simulation.advance(np.array([0.3, 0.3]), 0.1)
            simulation.observe(state)
            yaw, rear = state[YAW], robot.drive.rear_axle_x_m
            places.append([state[X] + rear * math.cos(yaw), state[Y] + rear * math.sin(yaw), yaw])
    path = np.array(places)
    way = np.sqrt((np.diff(path[:, :2], axis=0) ** 2).sum(axis=1)).sum()
    turned = np.unwrap(path[:, 2])[-1] - path[0, 2]
    assert way / turned == pytest.approx(robot.drive.wheelbase_m / math.tan(0.3), rel=0.05)


def test_steering_takes_as_long_at_every_step(engine: type[Rigid], experiment: Experiment) -> None:
    angles = []
    for step in STEPS:
        with open_alone(
            engine(time_step=step).open, experiment.robot, level(experiment)
        ) as simulation:
            simulation.advance(np.zeros(2), 1.0)
            simulation.advance(np.array([0.0, 0.3]), 0.1)
            joint = experiment.robot.drive.steering_joints[0]
            angles.append(probe(simulation).angle(joint))
    wanted = experiment.robot.drive.targets(0.0, 0.3)[0][0] * (1.0 - math.exp(-2.0))
    assert np.allclose(angles, wanted, rtol=0.05)


@pytest.mark.parametrize("step", [0.0, -0.01, 0.05, math.nan, "a", True])
def test_a_step_that_is_not_faithful_is_refused(engine: type[Rigid], step: Any) -> None:
    with pytest.raises(InputError, match="time_step"):
        engine(time_step=step)


def test_a_wall_is_touched_and_the_ground_never(
    engine: type[Rigid], experiment: Experiment
) -> None:
    """The front is 0.25 m ahead of the base frame, the wall 1 m: touched after 0.75 m."""
    state, touched = np.zeros(STATE_SIZE), []
    world = level(experiment, box("wall", 1.5))
    with open_alone(engine().open, experiment.robot, world) as simulation:
        for _ in range(50):
            simulation.advance(np.array([0.3, 0.0]), 0.1)
            simulation.observe(state)
            touched.append((state[X], state[CONTACT]))
    first = next(tick for tick, (_, contact) in enumerate(touched) if contact)
    assert touched[first][0] == pytest.approx(0.75, abs=0.03)
    assert all(x < touched[first][0] for x, _ in touched[:first])


def test_a_touch_between_two_observations_is_not_lost(
    engine: type[Rigid], experiment: Experiment
) -> None:
    state, world = np.zeros(STATE_SIZE), level(experiment, box("wall", 1.1))
    with open_alone(engine().open, experiment.robot, world) as simulation:
        simulation.advance(np.array([0.35, 0.0]), 2.0)  # against the wall
        simulation.advance(np.array([-0.35, 0.0]), 2.0)  # and away
        simulation.observe(state)
        assert state[CONTACT] == 1.0
        simulation.advance(np.zeros(2), 0.1)
        simulation.observe(state)
        assert state[CONTACT] == 0.0


def test_a_box_rests_until_a_force_moves_it(engine: type[Rigid], experiment: Experiment) -> None:
    world = going_on(level(experiment, box("box", 3.0, size=(0.6, 0.6, 0.1), mass=5.0)))
    with open_alone(engine(time_step=0.0025).open, experiment.robot, world) as simulation:
        bodies = probe(simulation)
        (start,) = bodies.movable()
        simulation.advance(np.zeros(2), 3.0)
        (rested,) = bodies.movable()
        assert rested.position == pytest.approx(start.position, abs=1e-5)
        for _ in range(200):  # 0.5 s; friction takes 5 kg * 9.81 m/s2 of the 80 N
            bodies.push(80.0)
            simulation.advance(np.zeros(2), 0.0025)
        x, _, z = bodies.movable()[0].position
    assert x - start.position[0] == pytest.approx(0.5 * (80 / 5 - 9.81) * 0.25, rel=0.05)
    assert z == pytest.approx(0.05, abs=0.005)


def test_a_rover_pushes_a_light_box(engine: type[Rigid], experiment: Experiment) -> None:
    world = going_on(level(experiment, box("box", 0.6, size=(0.3, 0.3, 0.3), mass=0.5)))
    with open_alone(engine().open, experiment.robot, world) as simulation:
        simulation.advance(np.array([0.3, 0.0]), 4.0)
        x, _, _ = probe(simulation).movable()[0].position
    assert x - 0.6 > 0.5


def test_ground_with_a_huge_friction_is_ground_with_that_of_the_wheels(
    engine: type[Rigid], experiment: Experiment
) -> None:
    ends = []
    for friction in (1.0, 100.0, 0.2):
        world = level(experiment)
        bodies = tuple(replace(body, friction=friction) for body in world.bodies)
        state = np.zeros(STATE_SIZE)
        with open_alone(
            engine().open, experiment.robot, replace(world, bodies=bodies)
        ) as simulation:
            simulation.advance(np.array([0.3, 0.5]), 3.0)
            simulation.observe(state)
        ends.append(state)
    np.testing.assert_array_equal(ends[0], ends[1])
    assert not np.array_equal(ends[0], ends[2])
