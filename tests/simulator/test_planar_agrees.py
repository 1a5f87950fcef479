"""The planar simulator against both engines: what they read, touch and drive in the same places."""

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rigid_cases import ENGINES, Rigid

from evoros.base.arrays import CONTACT, STATE_SIZE, YAW, Array, X, Y
from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.geometry.clearance import compute_clearances
from evoros.geometry.footprint import project_bodies
from evoros.robot.model import Robot
from evoros.sensor.protocol import sees
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import Simulator, open_alone
from evoros.simulator.pybullet import PyBullet
from evoros.world.model import World

pytestmark = pytest.mark.usefixtures("closed_engines")
WORLDS = ("boxes", "maze", "blocks")
PERIOD = 0.1  # [s]


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return compose([]).build()


def standing(
    count: int, robot: Robot, world: World, low: float, high: float = math.inf
) -> Iterator[World]:
    """The robot on the ground in places where its distance [m] to obstacles is low to high."""
    rng = np.random.default_rng(count)
    places = rng.uniform((-6.5, -6.5, -math.pi), (6.5, 6.5, math.pi), (2000, 3))
    gaps = compute_clearances(
        robot.outline, places, project_bodies(world.obstacles, robot.height_m)
    )
    for x, y, yaw in places[(gaps >= low) & (gaps <= high)][:count].tolist():
        course = replace(world.course, home_x_m=x, home_y_m=y, home_z_m=0.0, home_yaw_rad=yaw)
        with suppress(InputError):  # home inside of an obstacle
            yield replace(world, course=course)


def read(simulator: Simulator, robot: Robot, world: World) -> Array:
    readings = np.zeros(len(robot.mounts))
    with open_alone(simulator.open, robot, world) as simulation:
        simulation.sense(readings)
    return readings


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> Any:
    return request.param


@pytest.mark.parametrize("name", WORLDS)
def test_sensors_read_the_same_in_the_same_places(
    engine: type[Rigid], experiment: Experiment, name: str
) -> None:
    """PyBullet's rays are iterated, and end up to 2 mm early beside an edge."""
    rng = np.random.default_rng(0)
    apart = []
    for world in standing(10, experiment.robot, experiment.world[name], 0.001):
        design = experiment.space.decode(rng.random(experiment.space.size))
        robot = experiment.members[0].with_design(design).robot
        apart.append(read(Planar(), robot, world) - read(engine(), robot, world))
    far = np.abs(np.concatenate(apart))
    assert np.median(far) < 1e-6
    assert np.quantile(far, 0.95) < 1e-5
    assert far.max() < (2e-3 if engine is PyBullet else 1e-5)


@pytest.mark.parametrize("name", WORLDS)
def test_rays_end_where_the_planar_simulator_says(experiment: Experiment, name: str) -> None:
    """No ray of a sensor has been inside of anything before, and one of them is there."""
    rng = np.random.default_rng(1)
    design = experiment.space.decode(rng.random(experiment.space.size))
    robot = experiment.members[0].with_design(design).robot
    for world in standing(4, robot, experiment.world[name], 0.001):
        for i, reading in enumerate(read(Planar(), robot, world)):
            sensor = robot.sensors[robot.mounts[i].sensor]
            assert sees(sensor)
            rays = sensor.rays()
            before = np.arange(0.0, reading - 1e-7, 2e-3)
            assert not inside(robot, world, i, rays, before).any()
            if reading < 4.5:
                assert inside(robot, world, i, rays, np.array([reading + 1e-7])).any()


def inside(robot: Robot, world: World, sensor: int, rays: Array, ranges: Array) -> Array:
    """Whether a point of a ray at one of the ranges is inside of an obstacle or the ground."""
    x, y, _, yaw = world.course.home
    turn = np.array(
        [[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]]
    )
    frame = robot.sensor_frames[sensor]
    origin = turn @ frame[:3, 3] + (x, y, 0.0)
    ends = origin + ranges[:, None, None] * (rays @ (turn @ frame[:3, :3]).T)
    covered = ends[..., 2] < 0.0
    for body in world.obstacles:
        for shape in body.shapes:
            assert shape.kind == "box"
            pose = body.pose @ shape.pose
            local = np.abs((ends - pose.position) @ pose.rotation)
            covered |= (local < np.array(shape.size) / 2).all(axis=-1)
    return np.asarray(covered, dtype=np.float64)


@pytest.mark.slow
@pytest.mark.parametrize("name", WORLDS)
def test_they_touch_in_the_same_places(
    engine: type[Rigid], experiment: Experiment, name: str
) -> None:
    robot, full = experiment.robot, experiment.world[name]
    for touching, bounds in ((True, (0.0, 0.0)), (False, (1e-4, 0.05))):
        for world in standing(6, robot, full, *bounds):
            assert touches(engine(), robot, world) == touching
            assert touches(Planar(), robot, world) == touching


def touches(simulator: Simulator, robot: Robot, world: World) -> bool:
    state = np.zeros(STATE_SIZE)
    with open_alone(simulator.open, robot, world) as simulation:
        simulation.advance(np.zeros(2), simulator.time_step)
        simulation.observe(state)
    return bool(state[CONTACT] > 0.0)


@pytest.mark.parametrize(
    ("speed", "steering"), [(0.29, 0.0), (0.29, 0.3), (0.3175, -9.0), (-0.2, 0.2)]
)
def test_they_drive_the_same_way(experiment: Experiment, speed: float, steering: float) -> None:
    """A turn that grows and falls once in 10 s, against physics at a fine step."""
    world = experiment.world["boxes"]
    ground = tuple(body for body in world.bodies if body.is_ground)
    course = replace(world.course, home_z_m=0.0, home_yaw_rad=0.0)
    world = replace(world, bodies=ground, course=course)
    wanted = [np.array([speed, steering * math.sin(math.pi * k / 100)]) for k in range(100)]
    fine = PyBullet(time_step=0.0025, solver_iterations=50)
    real, plane = (
        drive(simulator, experiment.robot, world, wanted) for simulator in (fine, Planar())
    )
    assert np.abs(plane[:, [X, Y]] - real[:, [X, Y]]).max() < 0.01 * 10.0 * abs(speed)
    assert np.abs(plane[:, YAW] - real[:, YAW]).max() < math.radians(0.5)


def drive(simulator: Simulator, robot: Robot, world: World, wanted: list[Array]) -> Array:
    states = np.zeros((len(wanted), STATE_SIZE))
    with open_alone(simulator.open, robot, world) as simulation:
        for state, command in zip(states, wanted, strict=True):
            simulation.advance(command, PERIOD)
            simulation.observe(state)
    states[:, YAW] = np.unwrap(states[:, YAW])
    return states
