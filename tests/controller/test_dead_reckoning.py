"""Dead reckoning: exact with perfect sensors, drifts as analytic answers say, stands failures."""

import math
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from mission_cases import run_interpreted

from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.config.compose import compose
from evoros.controller.dead_reckoning import DeadReckoning
from evoros.controller.rover import Rover
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.filter.delay import Delay
from evoros.mission.mission import ESTIMATE, Mission
from evoros.mission.pipeline import describe_pose, start_localization
from evoros.mission.rollout import run_mission
from evoros.robot.model import Robot

QUIET = ["~design.sensors.imu.filters", "~design.sensors.odometry.filters"]
PERIOD = 0.1


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return compose(["experiment=reckoning"]).build()


@pytest.fixture(scope="module")
def robot(experiment: Experiment) -> Robot:
    return experiment.members[0].with_design(middle(experiment)).robot


def middle(experiment: Experiment) -> Design:
    return experiment.space.decode(np.full(experiment.space.size, 0.5))


def fly(experiment: Experiment, seed: str = "a") -> tuple[float, np.ndarray]:
    """The length [m] of a mission, and how far its estimated pose is off at each decision."""
    mission = Mission(0, 0, middle(experiment), "blocks", 0, "evaluation", seed)
    (outcome,), track = run_mission(experiment.scenario, mission)
    errors = track[:-1, [1, 2, 3]] - track[:-1, -3:]  # no decision at the end
    errors[:, 2] = np.remainder(errors[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    return outcome.distance_m, errors


@pytest.mark.slow
def test_perfect_sensors_know_the_pose() -> None:
    """But for what the steering does between two readings."""
    way, errors = fly(compose(["experiment=reckoning", *QUIET]).build())
    assert way > 20.0
    assert np.hypot(errors[:, 0], errors[:, 1]).max() < 0.01
    assert np.abs(errors[:, 2]).max() < 1e-6


@pytest.mark.slow
def test_noisy_sensors_drift_by_a_share_of_the_way(experiment: Experiment) -> None:
    missions = [fly(experiment, seed=seed) for seed in "abcd"]
    ends = [math.hypot(*errors[-1, :2]) / way for way, errors in missions]
    assert 1e-4 < np.median(ends) < 0.05
    assert np.array_equal(missions[0][1], fly(experiment, seed="a")[1])


def reckon(robot: Robot, rows: np.ndarray, imu: str | None = "imu") -> np.ndarray:
    """The poses (ticks, 4) for readings of speed, its yaw rate, and the rate of the IMU."""
    part = DeadReckoning(imu=imu)
    board = np.zeros(robot.channel_count)
    pose = np.array([1.0, 2.0, 0.5 * math.pi, 0.0])
    controller = replace(rover(), localization={"reckoning": part})
    stages = start_localization(
        controller, robot, board, describe_pose(pose, PERIOD), partial(generator, "test")
    )
    odometry, inertial = (
        robot.layout[[mount.sensor for mount in robot.mounts].index(kind)]
        for kind in ("odometry", "imu")
    )
    poses = []
    for tick, (speed, turn, rate) in enumerate(rows):
        board[odometry], board[inertial.start + 2] = (speed, turn), rate
        for stage in stages:
            stage.rule(*stage[2:7], tick * PERIOD)
        poses.append(pose.copy())
        pose[:] = math.nan  # it must not be read again
    return np.array(poses)


@cache
def rover() -> Rover:
    return compose(["simulator=planar"]).build().controller  # type: ignore[return-value]


def test_a_bias_of_the_yaw_rate_bends_the_way(robot: Robot) -> None:
    """After v t straight ahead, to the north: aside by half of b v t t, on a circle."""
    speed, bias, ticks = 0.3, 0.002, 400
    rows = np.tile([speed, 0.0, bias], (ticks, 1))
    rows[0] = 0.0
    x, y, yaw, told = reckon(robot, rows)[-1]
    turned = bias * (ticks - 1) * PERIOD
    arm = robot.drive.rear_axle_x_m
    radius = speed / bias
    assert yaw == pytest.approx(0.5 * math.pi + turned, abs=1e-9)
    assert x == pytest.approx(1.0 - radius * (1.0 - math.cos(turned)) + arm * math.sin(turned))
    assert y == pytest.approx(2.0 + radius * math.sin(turned) + arm * (1.0 - math.cos(turned)))
    assert told == speed


def test_silent_sensors_are_replaced_or_stay(robot: Robot) -> None:
    nan = math.nan
    rows = np.array([[0, 0, 0], [0.2, 0.5, nan], [nan, 0.7, 0.1], [nan, nan, nan]], dtype=float)
    yaws, speeds = reckon(robot, rows)[:, 2:].T
    assert np.allclose(np.diff(yaws), [0.05, 0.01, 0.01])
    assert np.allclose(speeds, [0.0, 0.2, 0.2, 0.2])
    by_wheels = reckon(robot, np.array([[0, 0, 0], [0.2, 0.5, 9.0]], dtype=float), None)
    assert by_wheels[-1, 2] - by_wheels[0, 2] == pytest.approx(0.05)


@pytest.mark.slow
def test_missions_are_the_same_compiled_and_have_the_estimate() -> None:
    failing = ["failure=random", "failure.count=8", "failure.earliest_s=5", "failure.latest_s=20"]
    failing += ["world.maze.course.time_limit_s=30"]
    experiment = compose(["experiment=reckoning", *failing]).build()
    mission = Mission(0, 0, middle(experiment), "maze", 0, "evaluation", "b")
    (outcome,), track = run_mission(experiment.scenario, mission)
    _, stepwise = run_mission(experiment.scenario, mission, run_interpreted)
    assert np.array_equal(track, stepwise, equal_nan=True)
    names = experiment.scenario.name_columns(mission.design, mission.world)
    assert names[-3:] == list(ESTIMATE)
    assert len(outcome.failed_sensors) == 8
    assert np.isfinite(track[:, -3:]).all()
    assert np.isnan(track[-1, names.index("rate_x_6_radps") - len(names)])


@pytest.mark.parametrize(
    ("overrides", "problem"),
    [
        (["design=six_sonars"], r"DeadReckoning.odometry: must be the name of a mounted Odometry"),
        (["controller.localization.dead_reckoning.imu=sonar"], r"DeadReckoning.imu: must be"),
        (
            ["design.sensors.imu.period_s=0.06", "simulator.time_step=0.02"],
            r"design.sensors.imu.period_s: must be a whole multiple of controller.period_s",
        ),
    ],
)
def test_what_is_missing_is_said_before_the_run(overrides: list[str], problem: str) -> None:
    experiment = compose(["experiment=reckoning", *overrides]).build()
    mission = Mission(0, 0, middle(experiment), "maze", 0, "evaluation", "b")
    with pytest.raises(InputError, match=problem):
        run_mission(experiment.scenario, mission)


def test_it_comes_before_filters(robot: Robot) -> None:
    board, place = np.zeros(robot.channel_count), describe_pose(np.zeros(4), PERIOD)
    draws = partial(generator, "test")
    after = replace(rover(), localization={"reckoning": DeadReckoning(), "late": Delay()})
    assert len(start_localization(after, robot, board, place, draws)) == 2
    before = replace(rover(), localization={"late": Delay(), "reckoning": DeadReckoning()})
    with pytest.raises(InputError, match=r"localization.reckoning: must come first"):
        start_localization(before, robot, board, place, draws)
