"""The rover's controller: who decides, which way, how sharply."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
from helpers import ROOT
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.random import Generator

from evoros.base.arrays import COMMAND_SIZE, DRIVE_SPEED, LEG_SIZE, STATE_SIZE, STEERING, YAW, Array
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.compilation.named_rules import bind
from evoros.controller.blind import Blind
from evoros.controller.protocol import LAYER_ARGUMENTS, Controller, Layer, StartedLayer
from evoros.controller.rover import Rover
from evoros.controller.serpentine import Serpentine
from evoros.controller.weighted_voting import WeightedVoting
from evoros.sensor.protocol import Mount
from evoros.sensor.sonar import Sonar

if TYPE_CHECKING:
    from evoros.robot.model import Robot

FULL_LOCK = 0.6
CONF = ROOT / "conf"


@dataclass(frozen=True)
class Drive:
    steering_limit: float = FULL_LOCK


@dataclass(frozen=True)
class Frame:
    """All that a controller asks of a robot."""

    yaws_deg: Sequence[float] = ()
    drive: Drive = field(default_factory=Drive)
    mounts: tuple[Mount, ...] = ()
    sensors: Mapping[str, Sonar] = field(default_factory=dict)

    @property
    def layout(self) -> list[slice]:
        return [slice(i, i + 1) for i in range(self.channel_count)]

    @property
    def channel_count(self) -> int:
        return len(self.yaws_deg)

    def channel_yaws(self) -> list[float]:
        return [math.radians(yaw) for yaw in self.yaws_deg]

    def mounted_sensors(self) -> list[Sonar]:
        return [self.sensors[mount.sensor] for mount in self.mounts]


def robot(*yaws_deg: float) -> "Robot":
    return cast("Robot", Frame(yaws_deg))


def decide(
    layer: Layer,
    yaws_deg: Sequence[float] = (),
    readings: Sequence[float] = (),
    state: Array | None = None,
    leg: Array | None = None,
    time: float = 0.0,
    seed: str = "seed",
) -> Array | None:
    """The command of a freshly started layer, None where it does not decide."""
    started = layer.start(robot(*yaws_deg), 0.1, generator(seed, "layer"))
    command = np.array([math.inf, math.inf])
    taken = bind(layer.rule, LAYER_ARGUMENTS, started)(
        np.zeros(STATE_SIZE) if state is None else state,
        np.array([0.0, 0.0, 5.0, 0.0]) if leg is None else leg,
        np.array(readings, dtype=float),
        time,
        command,
    )
    if not taken:
        assert np.isposinf(command).all(), "a layer that does not decide leaves the command alone"
        return None
    return command


def steering(yaws_deg: Sequence[float], readings: Sequence[float]) -> float:
    command = decide(WeightedVoting(), yaws_deg, readings)
    assert command is not None
    return float(command[STEERING])


# Weighted voting

facings = st.one_of(
    st.floats(-179, 179), st.sampled_from([-3.0, 3.0, 0.0, -90.0, 90.0, -3.0001, 3.0001])
)
ranges = st.one_of(st.floats(0.06, 4.5), st.just(math.nan), st.sampled_from([0.5, 2.0, 1.0, 1.5]))
sensors = st.lists(st.tuples(facings, ranges), max_size=8)


@given(sensors)
def test_it_decides_exactly_when_a_sensor_reads_less_than_the_threshold(
    pairs: list[tuple[float, float]],
) -> None:
    yaws, readings = [yaw for yaw, _ in pairs], [reading for _, reading in pairs]
    decided = decide(WeightedVoting(), yaws, readings) is not None
    assert decided == any(reading < 2.0 for reading in readings)


@given(sensors, st.floats(0.5, 4.0), st.floats(0.5, 6.0))
def test_the_turn_is_that_of_equation_2(
    pairs: list[tuple[float, float]], range_m: float, max_range_m: float
) -> None:
    layer = WeightedVoting(range_m=range_m, max_range_m=max_range_m)
    command = decide(layer, [yaw for yaw, _ in pairs], [reading for _, reading in pairs])
    assume(command is not None)
    assert command is not None
    weights = np.array([range_m - r if r < range_m else 0.0 for _, r in pairs])
    directions = np.array([1 if yaw <= 3.0 else -1 for yaw, _ in pairs])  # d_i, left positive
    total = float(directions @ weights)
    strength = min(1.0, 1 - (max_range_m - abs(total)) / max_range_m)
    expected = math.copysign(strength, total)
    left, right = weights[directions > 0].sum(), weights[directions < 0].sum()
    for edge in (abs(total) - 1.0, left - 1.5, right - 1.5):
        assume(abs(edge) > 1e-9)  # the sums of the two computations differ by rounding
    if abs(total) < 1 and min(left, right) > 1.5:
        expected = 1.0
    assert command[STEERING] == pytest.approx(expected * FULL_LOCK, abs=1e-9)
    assert command[DRIVE_SPEED] == 0.3175


@given(sensors)
def test_a_mirrored_robot_in_a_mirrored_world_steers_the_other_way(
    pairs: list[tuple[float, float]],
) -> None:
    pairs = [(yaw, reading) for yaw, reading in pairs if abs(yaw) > 3.1]
    assume(any(reading < 2.0 for _, reading in pairs))
    readings = [reading for _, reading in pairs]
    turn = steering([yaw for yaw, _ in pairs], readings)
    mirrored = steering([-yaw for yaw, _ in pairs], readings)
    if turn == mirrored == FULL_LOCK:  # a deadlock, which is left both ways
        near = [(yaw, 2.0 - reading) for yaw, reading in pairs if reading < 2.0]
        left = sum(weight for yaw, weight in near if yaw < 0)
        right = sum(weight for yaw, weight in near if yaw > 0)
        assert min(left, right) > 1.5
        assert abs(left - right) <= 1.0
    else:
        assert turn == -mirrored


@given(sensors)
def test_a_silent_sensor_is_as_good_as_none(pairs: list[tuple[float, float]]) -> None:
    heard = [(yaw, reading) for yaw, reading in pairs if not math.isnan(reading)]
    assume(any(reading < 2.0 for _, reading in heard))
    every = steering([yaw for yaw, _ in pairs], [reading for _, reading in pairs])
    assert every == steering([yaw for yaw, _ in heard], [reading for _, reading in heard])
    assert abs(every) <= FULL_LOCK


def test_a_sensor_votes_for_the_side_that_it_does_not_face() -> None:
    half = 0.5 * FULL_LOCK  # one vote of weight 1 of 2
    for yaw, expected in [
        (0.0, half),  # ahead votes left
        (3.0, half),  # still ahead
        (3.0 + 360.0, half),
        (3.001, -half),
        (60.0, -half),
        (-3.0, half),
        (-3.001, half),
        (-60.0, half),
        (300.0, half),  # -60 deg
    ]:
        assert steering([yaw], [1.0]) == pytest.approx(expected), yaw


def test_deadlock_needs_both_sums_above_the_threshold_and_a_small_difference() -> None:
    left_and_right = (-30.0, -30.0, 30.0, 30.0)

    def turn(left: float, right: float) -> float:
        """The steering for sums of votes that are exact in binary."""
        readings = [2.0 - left / 2, 2.0 - left / 2, 2.0 - right / 2, 2.0 - right / 2]
        return steering(left_and_right, readings) / FULL_LOCK

    assert turn(1.5, 1.5) == 0.0  # a sum of exactly 1.5 does not exceed it
    assert turn(1.75, 1.5) == 0.125
    assert turn(1.5, 1.75) == -0.125
    assert turn(1.75, 1.75) == 1.0
    assert turn(1.75, 2.75) == 1.0  # a difference of exactly 1
    assert turn(1.75, 3.0) == -0.625
    assert turn(3.5, 1.0) == 1.0
    assert turn(1.0, 3.5) == -1.0


def test_a_reading_of_exactly_the_threshold_is_no_obstacle() -> None:
    assert decide(WeightedVoting(), [0.0], [2.0]) is None
    assert decide(WeightedVoting(), [0.0], [math.nextafter(2.0, 0.0)]) is not None


# Serpentine


@given(
    st.floats(-3.1, 3.1),  # bearing
    st.floats(-20, 20),  # yaw
    st.floats(0, 540),
    st.floats(0, 60),
    st.floats(0.1, 5),
)
def test_the_serpentine_is_proportional_to_its_analytic_heading_error(
    bearing: float, yaw: float, time: float, amplitude: float, gain: float
) -> None:
    layer = Serpentine(amplitude_deg=amplitude, gain=gain)
    state = np.array([1.0, -2.0, yaw, 0.3, 0.0, 0.0])
    leg = np.array([0, 0, 1 + 3 * math.cos(bearing), -2 + 3 * math.sin(bearing)])
    command = decide(layer, state=state, leg=leg, time=time)
    assert command is not None
    phase = generator("seed", "layer").uniform(0, 2 * math.pi)
    weave = math.radians(amplitude) * math.sin(2 * math.pi * time / 9.7 + phase)
    error = np.angle(np.exp(1j * (bearing + weave - yaw)))
    assume(abs(error) < 3.141)  # behind: left or right alike
    expected = np.clip(gain * error, -FULL_LOCK, FULL_LOCK)
    assert command[STEERING] == pytest.approx(expected, abs=1e-9)
    assert command[DRIVE_SPEED] == 0.29


@given(st.text(max_size=8), st.floats(0, 540))
def test_the_serpentine_repeats_after_its_period_and_mirrors_after_half(
    seed: str, time: float
) -> None:
    layer = Serpentine(gain=0.5)

    def turn(when: float) -> float:
        command = decide(layer, time=when, seed=seed)
        assert command is not None
        return float(command[STEERING])

    assert turn(time + 9.7) == pytest.approx(turn(time), abs=1e-9)
    assert turn(time + 4.85) == pytest.approx(-turn(time), abs=1e-9)


def test_the_phase_is_drawn_for_each_mission_and_covers_the_circle() -> None:
    starts = [Serpentine().start(robot(), 0.1, generator(f"{i}", "x")).phase for i in range(200)]
    assert len(set(starts)) == 200
    assert np.histogram(starts, 4, (0, 2 * math.pi))[0].min() > 25


def test_a_silent_pose_leaves_the_last_command() -> None:
    state = np.zeros(STATE_SIZE)
    state[YAW] = math.nan
    assert decide(Serpentine(), state=state) is None


# The controller


def rng(name: str) -> Generator:
    return generator("mission", name)


def test_avoidance_comes_first_and_each_layer_draws_from_its_own_generator() -> None:
    rover = Rover(WeightedVoting(), Serpentine())
    assert rover.modes == ("avoiding", "navigating")
    with rover.open(robot(0.0), rng) as layers:
        phase = cast("Serpentine.Parameters", layers[1].started).phase
    assert phase == rng("navigation").uniform(0.0, 2.0 * math.pi)
    with Rover(Blind(), Serpentine()).open(robot(), rng) as others:
        assert cast("Serpentine.Parameters", others[1].started).phase == phase


@given(sensors)
def test_a_blind_rover_never_avoids(pairs: list[tuple[float, float]]) -> None:
    assert decide(Blind(), [yaw for yaw, _ in pairs], [reading for _, reading in pairs]) is None


def test_a_part_of_the_wrong_kind_is_refused() -> None:
    good = WeightedVoting(), Serpentine()
    attempts: list[Callable[[], object]] = [
        lambda: Rover("voting", good[1]),  # type: ignore[arg-type]
        lambda: Rover(good[0], None),  # type: ignore[arg-type]
        lambda: Rover(*good, period_s=0.0),
        lambda: Rover(*good, localization={"gps": 3}),  # type: ignore[dict-item]
    ]
    for bad in attempts:
        with pytest.raises(InputError, match="Rover"):
            bad()


# The configuration


def configured(*overrides: str) -> Controller:
    folder = str(CONF / "controller")
    with initialize_config_dir(folder, version_base="1.3"):
        configuration = compose("rover", list(overrides))
    controller = instantiate(configuration, _convert_="all")
    assert isinstance(controller, Controller)
    return controller


def test_the_configuration_states_the_defaults_of_the_classes() -> None:
    assert configured() == Rover(WeightedVoting(), Serpentine())
    assert configured("avoidance=blind") == Rover(Blind(), Serpentine())
    assert configured("avoidance.range_m=1") == Rover(WeightedVoting(range_m=1), Serpentine())


# A controller from outside


class Autopilot:
    """Stands for a live process: counts its ticks, and knows whether it still runs."""

    def __init__(self) -> None:
        self.running = True
        self.ticks = 0

    def steer(self, command: Array) -> bool:
        assert self.running
        self.ticks += 1
        command[:] = 0.2, 0.01 * self.ticks
        return True


@dataclass(frozen=True)
class External(Controller):
    """A controller beyond evoros: its one layer's rule is a method of what it opened."""

    started: list[Autopilot]
    period_s: float = 0.0025
    modes: Sequence[str] = ("navigating",)

    @contextmanager
    def open(
        self, robot: "Robot", rng: Callable[[str], Generator]
    ) -> Iterator[Sequence[StartedLayer]]:
        autopilot = Autopilot()
        self.started.append(autopilot)
        try:
            yield [StartedLayer(autopilot.steer, None)]
        finally:
            autopilot.running = False


def drive(controller: Controller, seconds: float, crash: bool = False) -> Array:
    """Run a controller as a mission does, at its own period; returns the last command."""
    command = np.zeros(COMMAND_SIZE)
    with controller.open(robot(0.0), rng) as layers:
        for tick in range(round(seconds / controller.period_s)):
            inputs = np.zeros(STATE_SIZE), np.zeros(LEG_SIZE), np.full(1, 4.5)
            for layer in layers:
                time = tick * controller.period_s
                if bind(layer.rule, LAYER_ARGUMENTS, layer.started)(*inputs, time, command):
                    break
        if crash:
            raise RuntimeError("the mission failed")
    return command


def test_a_live_controller_runs_at_its_own_period_and_is_released_with_the_mission() -> None:
    started: list[Autopilot] = []
    controller = External(started)
    assert isinstance(controller, Controller)
    assert drive(cast(Controller, controller), 1.0)[STEERING] == pytest.approx(4.0)
    with pytest.raises(RuntimeError, match="mission"):
        drive(cast(Controller, controller), 0.5, crash=True)
    assert [(autopilot.ticks, autopilot.running) for autopilot in started] == [
        (400, False),
        (200, False),
    ]


@pytest.mark.parametrize(("reach", "fits"), [(2.5, True), (2.0, True), (1.99, False)])
def test_a_sensor_that_sees_nothing_casts_no_vote(reach: float, fits: bool) -> None:
    short = Sonar(range_max_m=reach)
    mounts = (Mount("short", "base_link", 0.2, 0.0, 0.166, 0.0, 12.5),)
    carrier = cast("Robot", Frame((0.0,), mounts=mounts, sensors={"short": short}))
    if not fits:
        with pytest.raises(InputError, match=r"range_m: must be at most .* 1\.99"):
            WeightedVoting(range_m=2.0).start(carrier, 0.1, generator("seed", "layer"))
        return
    parameters = WeightedVoting(range_m=2.0).start(carrier, 0.1, generator("s", "l"))
    assert not WeightedVoting.rule(parameters, np.array([reach]), np.zeros(COMMAND_SIZE))
