"""The simulation in PyBullet: deterministic, and right where an analytic answer exists."""

import hashlib
import math
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from lxml import etree

from evoros.base.arrays import CONTACT, SPEED, STATE_SIZE, YAW, Array, X, Y
from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.mission.mission import Mission
from evoros.mission.rollout import run_mission
from evoros.robot.model import Robot
from evoros.sensor.protocol import Mount, Sensor
from evoros.sensor.sonar import Sonar
from evoros.simulator import pybullet as module
from evoros.simulator.pybullet import MAX_STEP_S, PyBullet
from evoros.world.model import World

STEPS = (0.0025, 0.005, 0.01, 0.02, MAX_STEP_S)
LIMITS = [f"world.{name}.course.time_limit_s=8" for name in ("boxes", "maze", "blocks")]
DIGEST = """
import hashlib, numpy as np
from tests.simulator.test_pybullet import experiment_of, flights
print(flights(experiment_of()))
"""


def experiment_of() -> Experiment:
    return compose(["failure=random", *LIMITS]).build()


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return experiment_of()


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    yield
    module.close_engines()


def mission(experiment: Experiment, world: str, number: int = 0, trial: int = 0) -> Mission:
    rng = np.random.default_rng(number)
    design = experiment.space.decode(rng.random(experiment.space.size))
    return Mission(0, number, design, world, trial, "evaluation", f"test:{number}:{trial}")


def flights(experiment: Experiment) -> str:
    """A digest of every bit of some missions."""
    digest = hashlib.sha256()
    for world in experiment.world:
        outcome, track = run_mission(experiment.scenario, mission(experiment, world))
        digest.update(track.tobytes() + repr(outcome).encode())
    return digest.hexdigest()


def level(experiment: Experiment, *bodies: Body) -> World:
    """Open ground with these bodies."""
    world = experiment.world["boxes"]
    ground = tuple(body for body in world.bodies if body.is_ground)
    course = replace(world.course, home_yaw_rad=0.0, home_z_m=0.0)
    return replace(world, bodies=(*ground, *bodies), course=course)


def box(
    name: str,
    x: float,
    y: float = 0.0,
    size: Sequence[float] = (1.0, 1.0, 1.0),
    mass: float | None = None,
) -> Body:
    edges = (float(size[0]), float(size[1]), float(size[2]))
    return Body(name, Pose((x, y, edges[2] / 2)), (Shape("box", edges),), mass=mass)


def beam(range_max_m: float = 4.5, **values: Any) -> Sonar:
    """A sensor of a single ray."""
    return Sonar(range_max_m=range_max_m, fov_deg=1.0, rays_per_axis=1, **values)


def mounted(
    experiment: Experiment, sensor: Sensor, *poses: tuple[float, float, float, float, float]
) -> Robot:
    """Sensors at x, y, z [m], yaw, pitch [deg] of the base link."""
    mounts = [Mount("sonar", "base_link", *pose) for pose in poses]
    return experiment.robot.with_sensors(mounts, {"sonar": sensor})


def ranges(robot: Robot, world: World, settle: float = 0.0) -> Array:
    readings = np.zeros(len(robot.mounts))
    with PyBullet().open(robot, world) as simulation:
        if settle:
            simulation.advance(np.zeros(2), settle)
        simulation.sense(readings)
    return readings


# Determinism: every bit.


def test_missions_repeat_in_a_process_and_in_a_fresh_one(experiment: Experiment) -> None:
    first = flights(experiment)
    assert flights(experiment) == first
    fresh = subprocess.run([sys.executable, "-c", DIGEST], capture_output=True, text=True)
    assert fresh.stdout.strip() == first, fresh.stderr


@pytest.mark.parametrize("world", ["boxes", "maze", "blocks"])
def test_a_mission_does_not_know_what_was_flown_before(experiment: Experiment, world: str) -> None:
    wanted = mission(experiment, world, 1)
    module.close_engines()
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
    robot = mounted(experiment, Sonar(), (0.2, 0.0, 0.166, 0.0, 12.5))
    tracks, models = [], []
    for rebuild in (True, False):
        with PyBullet().open(robot, world) as simulation:
            simulation.advance(command, 0.02 * steps)  # leaves contacts behind
        if rebuild:
            module.close_engines()
        with PyBullet().open(robot, world) as simulation:
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
        with PyBullet().open(experiment.robot, world) as simulation:
            models.append(simulation._model)
            simulation.advance(np.array([0.39, 0.0]), 3.0)
    assert models[0] is models[1]
    assert models[2] is not models[3]


def test_a_box_that_was_only_approached_is_put_back(experiment: Experiment) -> None:
    """The engine wakes a body nearby; awake, it settles, though nothing has touched it."""
    world = level(experiment, box("near", 0.0, 0.71, mass=50.0))
    tracks = []
    for _ in range(2):
        with PyBullet().open(mounted(experiment, beam(), (0, 0.1, 0.1, 90, 0)), world) as opened:
            tracks.append(track(opened, 5))
            assert not tracks[-1][:, CONTACT].any()
    assert np.array_equal(tracks[0], tracks[1])


def test_another_drive_on_the_same_model_is_obeyed(experiment: Experiment) -> None:
    world, state = level(experiment), np.zeros(STATE_SIZE)
    for limit in (0.397, 0.2):
        slow = replace(experiment.robot.drive, max_speed_mps=limit)  # type: ignore[type-var]
        with PyBullet().open(replace(experiment.robot, drive=slow), world) as simulation:
            simulation.advance(np.array([1.0, 0.0]), 3.0)
            simulation.observe(state)
        assert state[SPEED] == pytest.approx(limit, rel=0.02)


# Driving: geometry at every step.


@pytest.mark.parametrize("step", STEPS)
def test_turning_radius_and_speed_are_those_of_the_geometry(
    experiment: Experiment, step: float
) -> None:
    robot, state = experiment.robot, np.zeros(STATE_SIZE)
    with PyBullet(time_step=step).open(robot, level(experiment)) as simulation:
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


def test_steering_takes_as_long_at_every_step(experiment: Experiment) -> None:
    angles = []
    for step in STEPS:
        with PyBullet(time_step=step).open(experiment.robot, level(experiment)) as simulation:
            simulation.advance(np.zeros(2), 1.0)
            simulation.advance(np.array([0.0, 0.3]), 0.1)
            joint = simulation._bullet.getJointState(
                simulation._model.robot.body,
                simulation._model.robot.steering[0],
                simulation._client,
            )
            angles.append(joint[0])
    wanted = experiment.robot.drive.targets(0.0, 0.3)[0][0] * (1.0 - math.exp(-2.0))
    assert np.allclose(angles, wanted, rtol=0.05)


@pytest.mark.parametrize("step", [0.0, -0.01, 0.05, math.nan, "a", True])
def test_a_step_that_is_not_faithful_is_refused(step: Any) -> None:
    with pytest.raises(InputError, match="time_step"):
        PyBullet(time_step=step)


# Sensing: against geometry.


@pytest.mark.parametrize("yaw", [-120, -30, 0, 45, 180])
def test_a_wall_is_seen_where_it_is(experiment: Experiment, yaw: float) -> None:
    turn = math.radians(yaw)
    center = (2.5 * math.cos(turn), 2.5 * math.sin(turn), 1.0)
    wall = Body("wall", Pose.from_rpy(center, 0, 0, turn), (Shape("box", (1.0, 4.0, 2.0)),))
    at = (0.2 * math.cos(turn), 0.2 * math.sin(turn))
    robot = mounted(experiment, beam(), (*at, 0.3, yaw, 0), (*at, 0.3, yaw, 20))
    level_ray, raised = ranges(robot, level(experiment, wall))
    assert level_ray == pytest.approx(1.8, abs=1e-3)
    assert raised == pytest.approx(1.8 / math.cos(math.radians(20)), abs=1e-3)


@pytest.mark.parametrize("pitch", [-10, -35, -80])
def test_the_ground_is_seen(experiment: Experiment, pitch: float) -> None:
    robot = mounted(experiment, beam(), (0.25, 0.0, 0.4, 30, pitch))
    expected = 0.4 / math.sin(math.radians(-pitch))
    assert ranges(robot, level(experiment))[0] == pytest.approx(expected, rel=1e-3)


def test_a_cone_reads_its_nearest_ray(experiment: Experiment) -> None:
    """The lowest rays point 2.5 deg below the horizon, those to the side farthest from ahead."""
    robot = mounted(experiment, Sonar(range_max_m=20.0), (0.25, 0.0, 0.166, 0, 12.5))
    yaw, dip = math.radians(15), math.radians(-15)
    nose = math.radians(12.5)
    rays = [
        math.sin(nose) * math.cos(side) * math.cos(dip) + math.cos(nose) * math.sin(dip)
        for side in (0.0, yaw / 2, yaw)
    ]
    steepest = min(rays)
    assert ranges(robot, level(experiment), 1.0)[0] == pytest.approx(-0.166 / steepest, rel=1e-2)


def test_round_shapes_are_seen(experiment: Experiment) -> None:
    ball = Body("ball", Pose((2.0, 0.0, 0.5)), (Shape("sphere", (0.5,)),))
    pole = Body("pole", Pose((0.0, 2.0, 1.0)), (Shape("cylinder", (0.3, 2.0)),))
    robot = mounted(experiment, beam(), (0, 0, 0.5, 0, 0), (0, 0, 0.5, 90, 0))
    assert ranges(robot, level(experiment, ball, pole)) == pytest.approx([1.5, 1.7], abs=1e-3)


def test_readings_stay_in_the_range(experiment: Experiment) -> None:
    world = level(experiment, box("wall", 1.0))
    sensor = beam(range_max_m=0.8, range_min_m=0.4)
    robot = mounted(
        experiment, sensor, (0.2, 0, 0.3, 0, 0), (-0.4, 0, 0.3, 0, 0), (0, 0, 0.3, 0, 0)
    )
    near, far, between = ranges(robot, world)
    assert near == 0.4
    assert far == 0.8
    assert between == pytest.approx(0.5, abs=1e-3)


def test_a_robot_never_sees_itself(experiment: Experiment) -> None:
    """Backwards and down through chassis, cage and wheels."""
    rays = [(0.35, 0.0, 0.1, 180, 0), (0.15, 0.0, 0.3, 180, -10), (0.0, 0.3, 0.06, -90, 0)]
    robot = mounted(experiment, beam(range_max_m=1.0), *rays)
    assert (ranges(robot, level(experiment)) == 1.0).all()


def test_more_rays_than_one_call_takes(experiment: Experiment) -> None:
    dense = Sonar(rays_per_axis=81, fov_deg=10.0)
    poses = [(0.0, 0.0, 1.0, yaw, 0.0) for yaw in (0, 90, 180, 270)]
    robot = mounted(experiment, dense, *poses)
    walls = [box("ahead", 2.5, size=(1, 3, 3)), box("left", 0.0, 3.5, size=(3, 1, 3))]
    assert 4 * 81 * 81 > 16_383
    expected = [2.0, 3.0, 4.5, 4.5]
    assert ranges(robot, level(experiment, *walls)) == pytest.approx(expected, abs=1e-3)


def test_a_mission_without_sensors_flies(experiment: Experiment) -> None:
    wanted = mission(experiment, "maze")
    outcome, rows = run_mission(
        experiment.scenario, replace(wanted, design=replace(wanted.design, mounts=()))
    )
    assert outcome.sensors == 0
    assert outcome.distance_m > 1.0
    assert outcome.avoiding == 0.0
    assert rows.shape[1] == 9


# Touching and pushing.


def test_a_wall_is_touched_and_the_ground_never(experiment: Experiment) -> None:
    """The front is 0.25 m ahead of the base frame, the wall 1 m: touched after 0.75 m."""
    state, touched = np.zeros(STATE_SIZE), []
    world = level(experiment, box("wall", 1.5))
    with PyBullet().open(experiment.robot, world) as simulation:
        for _ in range(50):
            simulation.advance(np.array([0.3, 0.0]), 0.1)
            simulation.observe(state)
            touched.append((state[X], state[CONTACT]))
    first = next(tick for tick, (_, contact) in enumerate(touched) if contact)
    assert touched[first][0] == pytest.approx(0.75, abs=0.03)
    assert all(x < touched[first][0] for x, _ in touched[:first])


def test_a_touch_between_two_observations_is_not_lost(experiment: Experiment) -> None:
    state, world = np.zeros(STATE_SIZE), level(experiment, box("wall", 1.1))
    with PyBullet().open(experiment.robot, world) as simulation:
        simulation.advance(np.array([0.35, 0.0]), 2.0)  # against the wall
        simulation.advance(np.array([-0.35, 0.0]), 2.0)  # and away
        simulation.observe(state)
        assert state[CONTACT] == 1.0
        simulation.advance(np.zeros(2), 0.1)
        simulation.observe(state)
        assert state[CONTACT] == 0.0


def test_a_box_rests_until_a_force_moves_it(experiment: Experiment) -> None:
    world = level(experiment, box("box", 3.0, size=(0.6, 0.6, 0.1), mass=5.0))
    with PyBullet(time_step=0.0025).open(experiment.robot, world) as simulation:
        bullet, client = simulation._bullet, simulation._client
        body, (start, facing) = next(iter(simulation._model.movable.items()))
        simulation.advance(np.zeros(2), 3.0)
        assert bullet.getBasePositionAndOrientation(body, client) == (start, facing)
        bullet.changeDynamics(
            body, -1, activationState=bullet.ACTIVATION_STATE_WAKE_UP, physicsClientId=client
        )
        for _ in range(200):  # 0.5 s; friction takes 5 kg * 9.81 m/s2 of the 80 N
            bullet.applyExternalForce(
                body, -1, (80, 0, 0), (0, 0, 0), bullet.LINK_FRAME, physicsClientId=client
            )
            simulation.advance(np.zeros(2), 0.0025)
        (x, _, z), _ = bullet.getBasePositionAndOrientation(body, client)
    assert x - start[0] == pytest.approx(0.5 * (80 / 5 - 9.81) * 0.25, rel=0.05)
    assert z == pytest.approx(0.05, abs=0.005)


def test_a_rover_pushes_a_light_box(experiment: Experiment) -> None:
    world = level(experiment, box("box", 0.6, size=(0.3, 0.3, 0.3), mass=0.5))
    with PyBullet().open(experiment.robot, world) as simulation:
        bullet, client = simulation._bullet, simulation._client
        body, (start, _) = next(iter(simulation._model.movable.items()))
        simulation.advance(np.array([0.3, 0.0]), 4.0)
        (x, _, _), _ = bullet.getBasePositionAndOrientation(body, client)
    assert x - start[0] > 0.5


# The model that the engine gets.


def test_merged_links_move_as_the_separate_ones(
    experiment: Experiment, monkeypatch: pytest.MonkeyPatch
) -> None:
    design = mission(experiment, "boxes", 4).design
    robot = experiment.robot.with_sensors(design.mounts, experiment.design.sensors)
    tracks = []
    for separate in (False, True):
        module.close_engines()
        if separate:
            merging = "evoros.simulator.engines.pybullet_robot.merge_fixed_links"
            monkeypatch.setattr(
                merging, lambda root, kept: etree.tostring(root, encoding="unicode")
            )
        state, rows = np.zeros(STATE_SIZE), []
        with PyBullet().open(robot, level(experiment)) as simulation:
            joints = simulation._bullet.getNumJoints(
                simulation._model.robot.body, physicsClientId=simulation._client
            )
            assert joints == 6 + separate * len(design.mounts)
            for tick in range(100):
                simulation.advance(np.array([0.3, 0.4 * math.sin(0.06 * tick)]), 0.1)
                simulation.observe(state)
                rows.append(state[[X, Y, YAW]])
        tracks.append(np.array(rows))
    assert np.abs(tracks[0] - tracks[1]).max() < 1e-3
    assert np.ptp(tracks[0][:, 0]) > 2.0
