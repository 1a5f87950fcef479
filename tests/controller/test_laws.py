"""ArduPilot's law and follow the gap: analytic outputs, symmetry, ends of legs, and silence."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
from helpers import ROOT
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from evoros.base.arrays import DRIVE_SPEED, STEERING, Array
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.controller.follow_the_gap import WIDEST, FollowTheGap, block
from evoros.controller.l1 import L1, Memory, Parameters
from evoros.controller.rover import Rover
from evoros.controller.weighted_voting import WeightedVoting
from evoros.filter.delay import Delay
from evoros.filter.hold import Hold
from evoros.sensor.lidar import Lidar
from evoros.sensor.protocol import RangeSensor

if TYPE_CHECKING:
    from evoros.robot.model import Robot

FULL_LOCK = 0.6
PERIOD = 0.1
AXLE = 0.0  # [m]: the pose is that of the rear axle


def started(law: L1) -> tuple[Parameters, Memory]:
    robot = cast(
        "Robot",
        SimpleNamespace(drive=SimpleNamespace(steering_limit=FULL_LOCK, rear_axle_x_m=AXLE)),
    )
    return law.start(robot, PERIOD, generator("seed", "layer"))


class Call:
    """One mission of the law: its parameters and memory, called again and again."""

    def __init__(self, law: L1 | None = None) -> None:
        self.law = law or L1()
        self.parameters, self.memory = started(self.law)
        self.time = -PERIOD

    def __call__(
        self,
        x: float = 0.0,
        y: float = 0.0,
        yaw: float = 0.0,
        speed: float = 0.29,
        yaw_rate: float = 0.0,
        leg: tuple[float, float, float, float] = (-5.0, 0.0, 50.0, 0.0),
        wait: float = PERIOD,
    ) -> float:
        """The steering [rad] of the next call, ``wait`` seconds after the last."""
        self.time += wait
        command = np.full(2, math.inf)
        state = np.array([x, y, yaw, speed, yaw_rate, 0.0])
        named = self.parameters, self.memory
        if not self.law.rule(*named, state, np.array(leg), self.time, command):
            assert np.isposinf(command).all()
            return math.nan
        assert command[DRIVE_SPEED] == self.law.speed_mps
        return float(command[STEERING])


PURE = L1(i=0.0, d=0.0, crosstrack_gain=0.0)  # proportional: an output for each state alone

coordinates = st.floats(-20, 20)
yaws = st.floats(-7, 7)
speeds = st.floats(0, 3)


@given(st.floats(-2, 2), st.floats(-0.7, 0.7), st.floats(0.1, 3))
def test_on_the_leg_the_output_is_the_formula(y: float, yaw: float, speed: float) -> None:
    """Park's law and the feed-forward of the yaw rate, written for a leg along the x axis."""
    length = 0.75 * 6.0 * speed / math.pi
    eta = np.arcsin(np.clip(-y / length, -math.sqrt(0.5), math.sqrt(0.5))) - yaw
    acceleration = 2.25 * speed**2 / length * np.sin(np.clip(eta, -math.pi / 2, math.pi / 2))
    degrees = 45.0 * 1.8 * 0.75 * acceleration / max(speed, 1.0) ** 2
    expected = np.clip(degrees, -45, 45) / 45 * FULL_LOCK
    assert Call(PURE)(y=y, yaw=yaw, speed=speed) == pytest.approx(expected, abs=1e-9)


@given(coordinates, coordinates, yaws, speeds, st.floats(-1, 1), st.integers(1, 20))
def test_a_mirrored_rover_steers_the_other_way(
    x: float, y: float, yaw: float, speed: float, rate: float, calls: int
) -> None:
    assume(abs(math.sin(yaw)) > 1e-6 or math.cos(yaw) > 0)
    # Exactly away from where it should go, left and right are alike.
    here, mirrored = Call(), Call()
    for _ in range(calls):
        turn = here(x, y, yaw, speed, rate)
        other = mirrored(x, -y, -yaw, speed, -rate)
        assert abs(turn) <= FULL_LOCK
        if abs(abs(_aim_error(x, y, yaw, speed)) - math.pi) > 1e-6:
            assert turn == pytest.approx(-other, abs=1e-9)


def _aim_error(x: float, y: float, yaw: float, speed: float) -> float:
    """From the heading to the leg, its start or its end, whichever is half a turn off."""
    aims = (0.0, math.atan2(-y, -5.0 - x), math.atan2(-y, 50.0 - x))
    return max((math.remainder(aim - yaw, 2 * math.pi) for aim in aims), key=abs)


@given(coordinates, coordinates, yaws, st.floats(-math.pi, math.pi))
def test_the_law_knows_no_north(x: float, y: float, yaw: float, turn: float) -> None:
    cos, sin = math.cos(turn), math.sin(turn)

    def turned(x: float, y: float) -> tuple[float, float]:
        return cos * x - sin * y, sin * x + cos * y

    for aim in (0.0, math.atan2(-y, -5.0 - x)):
        assume(abs(abs(math.remainder(aim - yaw, 2 * math.pi)) - math.pi) > 1e-6)
    assume(abs(x + 5.0 + math.sqrt(0.5) * max(math.hypot(x + 5.0, y), 1.0)) > 1e-6)
    upright = Call(PURE)(x, y, yaw)
    moved = Call(PURE)(*turned(x, y), yaw + turn, leg=(*turned(-5.0, 0.0), *turned(50.0, 0.0)))
    assert moved == pytest.approx(upright, abs=1e-7)


def test_behind_the_start_it_aims_at_the_start_and_beyond_the_end_at_the_end() -> None:
    leg = (0.0, 0.0, 10.0, 0.0)
    for x, y, aim in ((-5.0, 2.0, (0, 0)), (-2.0, -1.0, (0, 0)), (15.0, 5.0, (10, 0))):
        course = math.atan2(aim[1] - y, aim[0] - x)
        assert Call(PURE)(x, y, course, leg=leg) == pytest.approx(0.0)
        assert Call(PURE)(x, y, course - 0.1, leg=leg) > 0.01
    beside = 5.0, 2.0, math.atan2(-2.0, -5.0)
    assert abs(Call(PURE)(*beside, leg=leg)) > 0.01


def test_a_leg_without_length_leads_to_its_point() -> None:
    for x, y in ((3.0, 4.0), (-2.0, 1.0)):
        assert Call(PURE)(x, y, math.atan2(-y, -x), leg=(0.0, 0.0, 0.0, 0.0)) == pytest.approx(0)


@given(st.floats(0.02, 0.1), st.integers(1, 100), speeds)
def test_the_integral_grows_with_the_error_of_the_yaw_rate_up_to_its_limit(
    rate: float, calls: int, speed: float
) -> None:
    """On the leg nothing is demanded, so the error is the measured rate."""
    call = Call()
    for _ in range(calls):
        turn = call(yaw_rate=rate, speed=speed)
    reckoned = max(speed, 1.0)  # what the steering takes for the speed [m/s]
    error = math.degrees(rate) / reckoned
    integral = -min(15.0, 0.2 * 0.75 * 45.0 * error / reckoned * PERIOD * calls)
    damping = -4.0 * 0.005 * error
    assert call.memory.integral[0] == pytest.approx(integral)
    assert turn == pytest.approx((integral + damping) / 45.0 * FULL_LOCK)


@pytest.mark.parametrize("side", [-1, 1])
def test_at_full_lock_the_integral_winds_no_further(side: int) -> None:
    call = Call(L1(p=9.0, i=0.02))
    for _ in range(100):
        assert call(yaw=-side * 1.5) == side * FULL_LOCK
    first = Call(L1(p=9.0, i=0.02))
    first(yaw=-side * 1.5)
    assert call.memory.integral[0] == first.memory.integral[0] != 0.0
    call(yaw=-side * 1.5, yaw_rate=side * 2.0)  # turning faster than demanded
    assert abs(call.memory.integral[0] - first.memory.integral[0]) > 1.0


def test_the_crosstrack_integral_is_slow_limited_and_only_near_the_leg() -> None:
    call = Call()
    for _ in range(50):
        call(y=-0.02)
    eta = math.asin(0.02 / (0.75 * 6 * 0.29 / math.pi))
    assert call.memory.crosstrack[0] == pytest.approx(0.02 * eta * PERIOD * 50)
    for _ in range(3000):
        call(y=-0.02)
    assert call.memory.crosstrack[0] == 0.1
    far = Call()
    far(y=-0.2)
    assert far.memory.crosstrack[0] == 0.0


def test_after_an_interruption_it_starts_afresh() -> None:
    fresh, interrupted = Call(), Call()
    for _ in range(20):
        interrupted(y=-0.03, yaw_rate=0.1)
    assert interrupted(y=0.3, wait=0.9) != fresh(y=0.3)
    assert interrupted(y=0.3, wait=1.1) == Call()(y=0.3)


@pytest.mark.parametrize("side", [-1, 1])
def test_after_an_interruption_full_lock_no_longer_holds_the_integral(side: int) -> None:
    """Anti-windup depends on the last output, which belongs to the time before."""
    law = L1(p=9.0, i=0.02)
    fresh, interrupted = Call(law), Call(law)
    for _ in range(3):
        interrupted(yaw=-side * 1.5)
    interrupted(yaw=-side * 1.5, wait=1.1)
    fresh(yaw=-side * 1.5)
    assert interrupted.memory.integral[0] == fresh.memory.integral[0] != 0.0


def test_a_silent_pose_leaves_the_command_and_the_memory() -> None:
    call = Call()
    call(y=-0.03, yaw_rate=0.1)
    before = [array.copy() for array in call.memory]
    for silent in range(4):
        x, y, yaw, speed = (math.nan if i == silent else 0.2 for i in range(4))
        assert math.isnan(call(x, y, yaw, speed))
    assert list(call.memory) == before


def test_the_configuration_states_the_defaults_and_the_lag() -> None:
    with initialize_config_dir(str(ROOT / "conf" / "controller"), version_base="1.3"):
        late = instantiate(compose("rover_l1"), _convert_="all")
        exact = instantiate(compose("rover", ["navigation=l1"]), _convert_="all")
    assert late == Rover(
        WeightedVoting(), L1(), localization={"hold": Hold(0.5), "delay": Delay(0.9)}
    )
    assert list(late.localization) == ["hold", "delay"]
    assert exact == Rover(WeightedVoting(), L1())


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
