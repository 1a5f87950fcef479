"""Ackermann geometry is held against the motion of a rigid body, not against its own formulas."""

import dataclasses
import math
from functools import cached_property

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.drive.ackermann import Ackermann, AckermannDescription
from evoros.formats.urdf import expansion
from evoros.formats.urdf.tree import Urdf, read_tree
from evoros.testing import DriveSuite


def drive(
    wheelbase: float = 0.334,
    kingpin_track: float = 0.269,
    steered_track: float = 0.269,
    fixed_track: float = 0.269,
    limit: float = 0.7727,
    radii: tuple[float, float] = (0.0635, 0.0635),
    steers_rear: bool = False,
) -> Ackermann:
    return Ackermann(
        steering_joints=("sl", "sr"),
        wheel_joints=("fl", "fr", "rl", "rr"),
        wheelbase_m=wheelbase,
        kingpin_track_m=kingpin_track,
        steered_track_m=steered_track,
        fixed_track_m=fixed_track,
        steered_radius_m=radii[0],
        fixed_radius_m=radii[1],
        rear_axle_x_m=-0.15,
        steering_stop_rad=limit,
        steering_limit_rad=limit,
        max_speed_mps=0.397,
        steers_rear=steers_rear,
    )


length = st.floats(0.1, 2.0)
radii = st.tuples(length, length)
drives = st.builds(
    drive, length, length, length, length, st.floats(0.05, 1.3), radii, st.booleans()
)
speeds = st.floats(-0.397, 0.397)
fractions = st.floats(-1.0, 1.0)


@given(drives, speeds, fractions)
def test_all_wheels_roll_as_one_rigid_body(car: Ackermann, speed: float, fraction: float) -> None:
    steering = fraction * car.steering_limit
    angles, rates = car.targets(speed, steering)
    yaw_rate = speed * math.tan(steering) / car.wheelbase_m
    half_kingpin = 0.5 * car.kingpin_track_m
    stub = 0.5 * (car.steered_track_m - car.kingpin_track_m)
    radii = (car.steered_radius_m,) * 2 + (car.fixed_radius_m,) * 2
    ahead = -car.wheelbase_m if car.steers_rear else car.wheelbase_m
    for i, (side, axle) in enumerate([(1, 1), (-1, 1), (1, 0), (-1, 0)]):
        heading = angles[i] if axle else 0.0
        # A steered wheel's centre swings about its steering axis, a stub axle's length away.
        x = axle * (ahead - side * stub * math.sin(heading))
        y = side * (half_kingpin + stub * math.cos(heading) if axle else 0.5 * car.fixed_track_m)
        body = np.array([speed - yaw_rate * y, yaw_rate * x])
        rolling = rates[i] * radii[i] * np.array([math.cos(heading), math.sin(heading)])
        np.testing.assert_allclose(rolling, body, atol=1e-12 * max(1.0, np.abs(body).max() * 10))


@given(drives, speeds, fractions)
def test_left_and_right_are_mirror_images(car: Ackermann, speed: float, fraction: float) -> None:
    steering = fraction * car.steering_limit
    (left, right), (fl, fr, rl, rr) = car.targets(speed, steering)
    assert car.targets(speed, -steering) == ((-right, -left), (fr, fl, rr, rl))


@given(drives)
def test_at_full_lock_the_inner_wheel_is_at_its_limit(car: Ackermann) -> None:
    limit, hand = car.steering_limit_rad, -1 if car.steers_rear else 1
    for lock in (car.steering_limit, 7.0):
        (left, right), _ = car.targets(0.1, lock)
        assert hand * left == pytest.approx(limit, abs=1e-12)
        assert hand * left <= limit
        assert 0 < hand * right < hand * left
        assert car.targets(0.1, -lock)[0] == (-right, -left)


@given(drives, fractions, fractions)
def test_more_steering_turns_both_wheels_further(car: Ackermann, a: float, b: float) -> None:
    low, high = sorted((a, b))
    if high - low < 1e-9:
        return
    less, _ = car.targets(0.1, low * car.steering_limit)
    more, _ = car.targets(0.1, high * car.steering_limit)
    hand = -1 if car.steers_rear else 1
    assert hand * less[0] < hand * more[0]
    assert hand * less[1] < hand * more[1]


@given(drives, speeds)
def test_straight_ahead_is_exact(car: Ackermann, speed: float) -> None:
    angles, rates = car.targets(speed, 0.0)
    assert angles == (0.0, 0.0)
    assert rates == (*(speed / car.steered_radius_m,) * 2, *(speed / car.fixed_radius_m,) * 2)


@given(drives, st.floats(-1e6, 1e6), fractions)
def test_speed_is_clipped(car: Ackermann, speed: float, fraction: float) -> None:
    clipped = min(max(speed, -car.max_speed_mps), car.max_speed_mps)
    steering = fraction * car.steering_limit
    assert car.targets(speed, steering) == car.targets(clipped, steering)


@given(drives, fractions)
def test_the_limit_of_the_speed_is_that_of_the_middle_of_the_fixed_axle(
    car: Ackermann, fraction: float
) -> None:
    assert car.speed_limit_offset_m == 0.0
    *_, left, right = car.targets(9.0, fraction * car.steering_limit)[1]
    speed = 0.5 * (left + right) * car.fixed_radius_m
    assert speed == pytest.approx(car.max_speed_mps, rel=1e-12)


def test_a_limit_beyond_the_stop_of_the_joints_is_refused() -> None:
    with pytest.raises(InputError, match=r"steering_limit_rad.*0\.7727.*0\.9"):
        dataclasses.replace(drive(), steering_limit_rad=0.9)


class TestAckermann(DriveSuite):
    part = AckermannDescription(
        steering_joints=["front_left_steering_joint", "front_right_steering_joint"],
        front_wheel_joints=["front_left_wheel_joint", "front_right_wheel_joint"],
        rear_wheel_joints=["rear_left_wheel_joint", "rear_right_wheel_joint"],
        steering_limit_rad=0.7,
        max_speed_mps=0.4,
    )
    bad_values = (
        {"steering_joints": ["a"]}, {"steering_joints": ["a", "a"]}, {"steering_joints": "ab"},
        {"front_wheel_joints": None}, {"rear_wheel_joints": ["e", 1]},
        {"steering_limit_rad": 1.6}, {"steering_limit_rad": 0}, {"steering_limit_rad": math.nan},
        {"max_speed_mps": -1}, {"max_speed_mps": "fast"}, {"turning_x_m": "front"},
        {"turning_x_m": math.inf},
    )  # fmt: skip

    @cached_property
    def urdf(self) -> Urdf:
        return read_tree(expansion.read("erle_rover/erle_rover.xacro")[1], "rover.urdf")
