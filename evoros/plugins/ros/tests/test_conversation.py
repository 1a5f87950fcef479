"""The common part of the bridges to ROS: commands of the bicycle model, and exact times."""

import math
from dataclasses import dataclass, field

import pytest

from evoros.plugins.ros.bridge.conversation import Modes, Schedule, Wheels, root_link, ros_time

WHEELBASE_M = 0.4


@dataclass
class Vector:
    x: float = 0.0
    z: float = 0.0


@dataclass
class Twist:
    linear: Vector = field(default_factory=Vector)
    angular: Vector = field(default_factory=Vector)


@dataclass
class TwistStamped:
    twist: Twist


@dataclass
class AckermannDrive:
    speed: float
    steering_angle: float


@dataclass
class AckermannDriveStamped:
    drive: AckermannDrive


def twist(speed: float, turn: float) -> Twist:
    return Twist(Vector(x=speed), Vector(z=turn))


def wheels(kind: str = "yaw_rate", turn_ratio: float = 1.0) -> Wheels:
    return Wheels({"wheelbase_m": WHEELBASE_M, "turn_ratio": turn_ratio}, kind)


@pytest.mark.parametrize("speed", [0.1, 2.0, -0.5])
@pytest.mark.parametrize("rate", [0.3, -0.2, 0.0])
@pytest.mark.parametrize("turn_ratio", [1.0, 0.6])
def test_the_steering_angle_gives_the_yaw_rate(
    speed: float, rate: float, turn_ratio: float
) -> None:
    driven, steering = wheels(turn_ratio=turn_ratio).read(TwistStamped(twist(speed, rate)))
    assert driven == speed
    curvature = turn_ratio * math.tan(steering) / WHEELBASE_M
    assert speed * curvature == pytest.approx(rate)


def test_at_speed_zero_the_steering_angle_stays() -> None:
    drive = wheels()
    _, before = drive.read(twist(0.5, 0.4))
    assert before != 0.0
    assert drive.read(twist(0.0, -1.0)) == (0.0, before)


def test_a_twist_can_mean_the_steering_angle() -> None:
    assert wheels("steering").read(twist(0.0, 0.25)) == (0.0, 0.25)


def test_ackermann_commands_are_taken_as_they_are() -> None:
    drive = AckermannDrive(0.5, -0.25)
    assert wheels().read(drive) == wheels().read(AckermannDriveStamped(drive)) == (0.5, -0.25)


@pytest.mark.parametrize("rate", [math.inf, -math.inf, math.nan])
def test_a_number_that_is_not_finite_is_not_hidden(rate: float) -> None:
    _, steering = wheels().read(twist(0.5, rate))
    assert not math.isfinite(steering)


def test_a_mission_begins_at_a_second_and_its_times_are_the_nearest_nanoseconds() -> None:
    assert ros_time(0.0) == (1, 0)
    for tick in range(2000):
        assert ros_time(tick * 0.1) == divmod(10**9 + tick * 10**8, 10**9)


def test_a_sensor_is_due_at_each_multiple_of_its_period_or_at_the_next_tick() -> None:
    schedule = Schedule([{"period_s": 0.1}, {"period_s": 0.3}, {"period_s": 0.25}])
    due = [schedule.due(tick * 0.1) for tick in range(7)]
    assert due == [[0, 1, 2], [0], [0], [0, 1, 2], [0], [0, 2], [0, 1]]


def test_an_unknown_mode_is_answered_as_it_is() -> None:
    modes = Modes(["navigating", "avoiding"])
    told = [modes.now]
    for name in ("avoiding", "dancing", "navigating"):
        modes.report(name)
        told.append(modes.now)
    assert told == [1, 2, "dancing", 1]


def test_the_root_link_is_no_joint_s_child() -> None:
    joints = (("wheel", "axle"), ("axle", "base"))
    links = "".join(f'<link name="{name}"/>' for name in ("wheel", "axle", "base"))
    text = "".join(
        f'<joint name="to_{child}"><parent link="{parent}"/><child link="{child}"/></joint>'
        for child, parent in joints
    )
    assert root_link(f"<robot>{links}{text}</robot>") == "base"
