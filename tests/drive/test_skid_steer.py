"""Skid-steer, against the balance of moments."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from evoros.base.errors import InputError
from evoros.drive.skid_steer import SkidSteer, SkidSteerDescription, compute_turning_resistance
from evoros.formats.urdf.tree import Urdf, read_tree
from evoros.testing import DriveSuite

length = st.floats(0.05, 2.0)


@given(length, length, st.floats(-1.0, 1.0))
def test_four_wheels_have_an_analytic_resistance(base: float, track: float, x: float) -> None:
    resistance = compute_turning_resistance([x + base / 2, x - base / 2], [track] * 2)
    assert resistance == pytest.approx(1.0 + (base / track) ** 2, rel=1e-9)


@given(st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(0.8, 1.2)), min_size=2, max_size=6))
def test_the_moments_are_in_balance(axles: list[tuple[float, float]]) -> None:
    """Moment of the friction forces, each of which is against the slip of its wheel."""
    places, tracks = np.array(axles).T
    x, mean = places - places.mean(), tracks.mean()
    resistance = compute_turning_resistance(places.tolist(), tracks.tolist())
    if np.abs(x).max() < 1e-3 or resistance == 1.0:
        return
    slip = 0.5 * (resistance * mean - tracks)  # rim speed less that of the ground, at 1 rad/s
    size = np.hypot(slip, x)
    forward, sideways = slip / size, -x / size
    moment = (tracks / 2 * forward + x * sideways)[size > 0].sum()
    assert moment == pytest.approx(0.0, abs=1e-6)


def test_known_values() -> None:
    assert compute_turning_resistance([0.0], [0.5]) == 1.0
    assert compute_turning_resistance([0.2, -0.2], [0.4] * 2) == pytest.approx(2.0)
    # The middle wheels of six do not slide sideways, so they help to turn.
    six = compute_turning_resistance([0.2, 0.0, -0.2], [0.4] * 3)
    assert 1.0 < six < 2.0


def drive(multiplier: float = 1.5, resistance: float = 1.5, lock: float = 0.9) -> SkidSteer:
    return SkidSteer(
        wheel_joints=("fl", "rl", "fr", "rr"),
        caster_links=(),
        wheelbase_m=0.4,
        track_m=0.4,
        wheel_radii_m=(0.1, 0.2),
        rear_axle_x_m=0.0,
        steering_limit_rad=lock,
        max_speed_mps=1.0,
        wheel_separation_multiplier=multiplier,
        turning_resistance=resistance,
    )


@given(st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(1.0, 3.0), st.floats(1.0, 3.0))
def test_the_wheels_turn_the_robot_that_seems_wider(
    speed: float, steering: float, multiplier: float, resistance: float
) -> None:
    robot = drive(multiplier, resistance)
    angles, (fl, rl, fr, rr) = robot.targets(speed, steering)
    assert angles == ()
    assert (fl, fr) == pytest.approx((2.0 * rl, 2.0 * rr), rel=1e-12)  # all rims are as fast
    commanded = math.tan(max(min(steering, 0.9), -0.9)) / 0.4
    middle, turned = (fl + fr) * 0.05, (fr - fl) * 0.1 / (0.4 * resistance)
    assert turned == pytest.approx(middle * commanded * robot.turn_ratio, abs=1e-12)
    assert max(abs(fl), abs(fr)) * 0.1 <= 1.0 + 1e-12
    # Every simulator limits the speed by the curvature that is driven.
    driven = abs(commanded * robot.turn_ratio)
    assert abs(middle) <= 1.0 / (1.0 + driven * robot.speed_limit_offset_m) + 1e-12


WHEEL = """<link name="{0}"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01"/>
</inertial><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="{0}_joint" type="continuous"><parent link="base"/><child link="{0}"/>
<origin xyz="{1} {2} 0.1"/><axis xyz="0 1 0"/><limit effort="9" velocity="9"/></joint>"""


def described(wider: float = 0.0) -> Urdf:
    places = {"fl": (0.2, 0.2), "fr": (0.2, -0.2), "rl": (-0.2, 0.2 + wider)}
    places["rr"] = (-0.2, -0.2 - wider)
    wheels = "".join(WHEEL.format(name, x, y) for name, (x, y) in places.items())
    text = f'<robot name="r"><link name="base"/>{wheels}</robot>'
    return read_tree(etree.fromstring(text), "r.urdf")


def description(**values: Any) -> SkidSteerDescription:
    sides = {"left_wheel_joints": ["fl_joint", "rl_joint"]}
    sides["right_wheel_joints"] = ["fr_joint", "rr_joint"]
    numbers = {"wheelbase_m": 0.4, "steering_limit_rad": 0.9, "max_speed_mps": 1.0}
    return SkidSteerDescription(**{**sides, **numbers, **values})


class TestSkidSteer(DriveSuite):
    part = description()
    bad_values = ({"turning_resistance": 0.5}, {"left_wheel_joints": ["fl_joint"]})
    urdf = described()


def test_the_resistance_is_computed_unless_it_is_given() -> None:
    fitted = description().fit(described())
    assert fitted.turning_resistance == pytest.approx(2.0)
    assert fitted.wheel_separation_multiplier == fitted.turning_resistance
    assert fitted.turn_ratio == 1.0
    fitted = description(wheel_separation_multiplier=1.0).fit(described())
    assert fitted.turn_ratio == pytest.approx(0.5)
    fitted = description(turning_resistance=1.5).fit(described())
    assert (fitted.wheel_separation_multiplier, fitted.turn_ratio) == (1.5, 1.0)
    assert description().fit(described(wider=0.05)).track_m == pytest.approx(0.45)


def test_what_does_not_fit_is_one_clear_line() -> None:
    with pytest.raises(InputError, match="the same number of wheels"):
        description(left_wheel_joints=["fl_joint", "rl_joint", "a"]).fit(described())
