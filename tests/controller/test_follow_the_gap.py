"""Follow the gap: the free side, the speed ahead, symmetry, and silence."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.base.arrays import DRIVE_SPEED, STEERING, Array
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.controller.follow_the_gap import WIDEST, FollowTheGap, block
from evoros.sensor.lidar import Lidar
from evoros.sensor.protocol import RangeSensor

if TYPE_CHECKING:
    from evoros.robot.model import Robot

YAWS = np.radians(np.linspace(-135.0, 135.0, 271))  # a reading for each degree
AHEAD = 135
LAW = FollowTheGap()
LOCK = 1.2
DRIVE = SimpleNamespace(steering_limit=LOCK)
SENSOR = Lidar(beams=len(YAWS), fov_deg=270.0, range_max_m=30.0)


def robot(*sensors: RangeSensor) -> "Robot":
    parts = {"drive": DRIVE, "channel_yaws": YAWS.tolist, "mounted_sensors": lambda: sensors}
    return cast("Robot", SimpleNamespace(**parts))


ROBOT = robot(SENSOR)


def decide(readings: Array, goal: float = 0.0, law: FollowTheGap = LAW) -> tuple[float, float]:
    """The speed and the steering at the origin, with the waypoint 10 m away at a bearing [rad]."""
    named = law.start(ROBOT, 0.1, generator("a", "b"))
    leg = np.array([0.0, 0.0, 10.0 * math.cos(goal), 10.0 * math.sin(goal)])
    command = np.full(2, math.nan)
    if not law.rule(*named, np.zeros(6), leg, readings, command):
        return math.nan, math.nan
    return float(command[DRIVE_SPEED]), float(command[STEERING])


def nothing() -> Array:
    return np.full(len(YAWS), 30.0)


def test_a_sensor_that_sees_less_far_is_refused() -> None:
    """It reports its maximum if it sees nothing, which would block its direction."""
    law, short = FollowTheGap(range_m=2.0), replace(SENSOR, range_max_m=1.9)
    with pytest.raises(InputError, match=r"range_m: must be at most .*, 1\.9, not 2"):
        law.start(robot(SENSOR, short), 0.1, generator("a", "b"))
    law.start(robot(SENSOR, replace(SENSOR, range_max_m=2.0)), 0.1, generator("a", "b"))


def test_where_nothing_is_near_others_decide() -> None:
    assert math.isnan(decide(nothing())[0])
    assert math.isnan(decide(np.full(len(YAWS), math.nan))[0])
    near = nothing()
    near[AHEAD] = 1.0
    assert math.isnan(decide(near, math.nan)[0])  # the pose is silent


@settings(max_examples=30)
@given(st.integers(10, 60), st.floats(0.5, 1.9))
def test_it_turns_to_the_free_side(width: int, range_m: float) -> None:
    """An obstacle from straight ahead to the left, with the waypoint behind it."""
    wall = nothing()
    wall[AHEAD - 2 : AHEAD + width] = range_m
    _, steering = decide(wall)
    assert steering < 0.0


@settings(max_examples=30)
@given(st.integers(0, 250), st.integers(1, 60), st.floats(0.1, 1.9), st.floats(0.2, 1.0))
def test_the_mirror_image_gives_the_mirror_image(
    first: int, width: int, range_m: float, goal: float
) -> None:
    readings = nothing()
    readings[first : first + width] = range_m
    speed, steering = decide(readings, goal)
    mirrored_speed, mirrored = decide(readings[::-1].copy(), -goal)
    assert mirrored_speed == pytest.approx(speed, abs=1e-9)
    assert abs(steering) <= LOCK
    step = LAW.gain * math.pi / 180.0  # between two headings that are tried
    assert mirrored == pytest.approx(-steering, abs=1.01 * step)


def test_a_reading_blocks_only_the_directions_that_it_should() -> None:
    """A disc of 0.3 m that must pass a point at 0.6 m stays 30 deg off it."""
    named = LAW.start(ROBOT, 0.1, generator("a", "b"))
    for yaw in (-89.0, -40.0, 0.0, 75.0, 100.0, 130.0):
        readings = nothing()
        readings[int(yaw) + AHEAD] = 0.6
        block(*named[:1], named[1].free, readings, 2.0)
        directions = np.degrees(np.linspace(-WIDEST, WIDEST, len(named[1].free)))
        away = np.abs(directions - yaw)
        assert (named[1].free[away < 29.99] == 0.0).all()
        assert (named[1].free[away > 30.01] == 1.0).all()


@settings(max_examples=30)
@given(st.floats(0.31, 1.9))
def test_the_speed_rises_with_the_free_way_ahead(range_m: float) -> None:
    wall = nothing()
    wall[AHEAD] = range_m
    speed, _ = decide(wall)
    free = min(range_m - LAW.radius_m, LAW.slowing_m)
    share = free / LAW.slowing_m
    assert speed == pytest.approx(LAW.min_speed_mps + share * (LAW.speed_mps - LAW.min_speed_mps))
