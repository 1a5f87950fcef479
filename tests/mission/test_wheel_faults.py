"""A weak wheel: in the plane as geometry has it, in the engines as in the plane."""

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from fault_cases import NOW, Steady, configured, fly, measure_circle
from proposal_sites import is_of
from rigid_cases import ENGINES, Rigid

from evoros.base.errors import InputError
from evoros.failure.combined import CombinedFailure
from evoros.failure.onset.time import TimeOnset
from evoros.failure.part import PartFailure
from evoros.filter.constant import Constant
from evoros.simulator.mujoco import Mujoco

SPEED = 0.2
STRENGTHS = [(0.5, 1.0), (1.0, 0.5), (0.0, 1.0), (1.0, 0.9), (0.7, 0.2)]
"""Of the left and the right wheels."""


ROBOTS = {
    "two_wheeler": ("robot=two_wheeler",),
    "mule": ("robot=mule", "design=around"),
    "erle_rover": (),
}


def weak(left: float, right: float) -> CombinedFailure:
    """Both sides have a strength from the start."""
    now, sides = TimeOnset(0.0, 0.0), {"left_wheel": left, "right_wheel": right}
    return CombinedFailure(
        {part: PartFailure(part, 1.0, now, Constant(value)) for part, value in sides.items()}
    )


def predict(left: float, right: float, robot: str, steering: float) -> tuple[float, float]:
    """Speed [m/s] and yaw rate [rad/s] of a robot whose sides turn at shares of their rates."""
    drive = configured(*ROBOTS[robot]).robot.drive
    half, turn = drive.speed_limit_offset_m, SPEED * math.tan(steering) / drive.wheelbase_m
    slow, fast = left * (SPEED - half * turn), right * (SPEED + half * turn)
    return 0.5 * (slow + fast), 0.5 * (fast - slow) / half


def drive(
    left: float, right: float, robot: str, steering: float = 0.0, simulator: Any = None
) -> pd.DataFrame:
    parts = {"controller": Steady(SPEED, steering), "simulator": simulator}
    _, track = fly(*ROBOTS[robot], **parts, failure=weak(left, right), time_limit_s=20.0)
    return track[track["time_s"] > 2.0].iloc[:-1]


def turning(track: pd.DataFrame) -> float:
    """The yaw rate [rad/s]."""
    yaw, time = np.unwrap(track["yaw_rad"]), track["time_s"].to_numpy()
    return float((yaw[-1] - yaw[0]) / (time[-1] - time[0]))


@pytest.mark.parametrize("steering", [0.0, 0.5, -0.5])
@pytest.mark.parametrize(("left", "right"), STRENGTHS)
@pytest.mark.parametrize("robot", ["two_wheeler", "mule"])
def test_a_weak_side_turns_the_robot_as_geometry_says(
    robot: str, left: float, right: float, steering: float
) -> None:
    """Of the two wheels, and of wheels that slip, on the track that they seem to have."""
    speed, rate = predict(left, right, robot, steering)
    track = drive(left, right, robot, steering)
    assert track["speed_mps"].to_numpy() == pytest.approx(speed, rel=1e-9)
    assert turning(track) == pytest.approx(rate, rel=1e-9)


def test_the_radius_of_a_weak_wheel_follows_from_the_track() -> None:
    """Straight ahead, track / 2 times (1 + f) / (1 - f); a dead wheel is the centre of the turn."""
    robot = configured(*ROBOTS["two_wheeler"]).robot
    for share in (0.0, 0.4, 0.9):
        radius = 0.29 / 2 * (1 + share) / (1 - share)
        track = drive(1.0, share, "two_wheeler")
        assert measure_circle(track, robot) == pytest.approx(radius, rel=1e-6)


@pytest.mark.parametrize(("left", "right"), STRENGTHS)
def test_one_motor_with_differentials_keeps_its_curve(left: float, right: float) -> None:
    track = drive(left, right, "erle_rover", 0.3)
    robot = configured().robot
    weaker = min(left, right)
    assert track["speed_mps"].to_numpy() == pytest.approx(weaker * SPEED, rel=1e-9)
    if weaker:
        radius = robot.drive.wheelbase_m / math.tan(0.3)
        assert measure_circle(track, robot) == pytest.approx(radius, rel=1e-6)
    else:
        assert np.ptp(track[["x_m", "y_m", "yaw_rad"]].to_numpy(), axis=0).max() == 0.0


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("left", "right"), [(0.5, 1.0), (1.0, 0.0)])
def test_engines_turn_as_the_plane_does(engine: type[Rigid], left: float, right: float) -> None:
    """Two wheels, and four of which two are steered, within 2 %."""
    speed, rate = predict(left, right, "two_wheeler", 0.0)
    track = drive(left, right, "two_wheeler", simulator=engine())
    assert turning(track) == pytest.approx(rate, rel=0.02)
    assert track["speed_mps"].mean() == pytest.approx(speed, rel=0.02)
    rover = drive(left, right, "erle_rover", 0.3, engine())
    plane = drive(left, right, "erle_rover", 0.3)
    speed, rate = float(plane["speed_mps"].mean()), turning(plane)
    assert rover["speed_mps"].mean() == pytest.approx(speed, rel=0.02, abs=1e-3)
    assert turning(rover) == pytest.approx(rate, rel=0.02, abs=1e-3)


@pytest.mark.parametrize(("left", "right"), [(0.5, 1.0), (1.0, 0.8)])
def test_wheels_that_slip_turn_nearly_as_in_the_plane(left: float, right: float) -> None:
    speed, rate = predict(left, right, "mule", 0.0)
    track = drive(left, right, "mule", simulator=Mujoco())
    assert turning(track) == pytest.approx(rate, rel=0.05)
    assert track["speed_mps"].mean() == pytest.approx(speed, rel=0.05)


def test_until_its_onset_a_failure_changes_no_bit() -> None:
    late = [f"failure.onset.{key}=4" for key in ("earliest_s", "latest_s")]
    overrides = ("robot=two_wheeler", "failure=wheel", *late)
    outcome, track = fly(*overrides, time_limit_s=8.0)
    _, again = fly(*overrides, time_limit_s=8.0)
    _, whole = fly("robot=two_wheeler", time_limit_s=8.0)
    before = track["time_s"] <= 4.0
    assert (outcome.failed_parts, outcome.parts_failed_at_s) == (("left_wheel",), (4.0,))
    assert track.to_numpy().tobytes() == again.to_numpy().tobytes()
    moved = ["x_m", "y_m", "yaw_rad", "speed_mps", "steering_rad"]
    assert track[before][moved].equals(whole[before][moved])
    assert not track[~before][moved].equals(whole[~before][moved])


def test_a_wheel_without_current_is_a_dead_one() -> None:
    """Its strength is silent."""
    tracks = [
        fly("robot=two_wheeler", "failure=wheel", f"filter@failure.effect={effect}", *NOW)[1]
        for effect in ("constant", "silence")
    ]
    assert tracks[0].equals(tracks[1])


def test_a_simulator_without_weak_wheels_refuses_them_in_one_line() -> None:
    class Strong(Mujoco):
        weakens_wheels = False

    with pytest.raises(InputError, match="does not model weak wheels") as refusal:
        fly("robot=two_wheeler", "failure=wheel", simulator=Strong(), time_limit_s=1.0)
    assert "\n" not in str(refusal.value)
    assert is_of(str(refusal.value), "evoros/mission/setup.py failure=drive")
    fly("robot=two_wheeler", "failure=drive", simulator=Strong(), time_limit_s=1.0)
    fly("robot=two_wheeler", "failure=wheel", time_limit_s=1.0)
