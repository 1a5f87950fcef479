"""Missions of an engine or a live controller: compiled but for the calls of Python.

No error and no interruption is lost.
"""

import gc
import signal
import sys
import time
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from helpers import with_parts
from mission_cases import run_interpreted, watch

from evoros.base.arrays import (
    COMMAND_SIZE,
    DRIVE_SPEED,
    LEG_SIZE,
    SPEED,
    STATE_SIZE,
    STEERING,
    YAW,
    Array,
)
from evoros.base.errors import PilotLost, SimulationError
from evoros.config.compose import compose
from evoros.controller.protocol import Briefing, LiveController
from evoros.evolution.experiment import Experiment
from evoros.mission.compiled_loop import run_call
from evoros.mission.inputs import _bind_layer
from evoros.mission.loop import run_loop
from evoros.mission.mission import SIMULATION_FAILURE, Mission
from evoros.mission.rollout import run_mission
from evoros.mission.scenario import Scenario
from evoros.simulator.protocol import PlacedRobot, Simulator
from evoros.world.model import World


@dataclass
class Wreck:
    """A simulation whose robot stands still, and that raises an error at its nth call of a kind."""

    fails: str = ""
    count: int = 0
    error: BaseException = field(default_factory=lambda: SimulationError("the axle is broken"))
    calls: list[str] = field(default_factory=list)

    def _call(self, name: str) -> None:
        self.calls.append(name)
        if self.calls.count(name) == self.count and name == self.fails:
            raise self.error

    def observe(self, state: Array) -> None:
        self._call("observe")
        state[:] = 0.0
        state[SPEED] = len(self.calls)

    def sense(self, signals: Array) -> None:
        self._call("sense")
        signals[:] = 1.0

    def advance(self, command: Array, duration: float) -> None:
        self._call("advance")


@dataclass(frozen=True)
class Engine(Simulator):
    """A simulator that opens what it is given."""

    wreck: Any
    time_step = 0.1
    packages = ()

    @contextmanager
    def open(self, robots: Sequence[PlacedRobot], world: World) -> Iterator[Any]:
        yield self.wreck


@cache
def experiment_of(*overrides: str) -> Experiment:
    return compose(["failure=random", "course.time_limit_s=12", *overrides]).build()


def first_mission(experiment: Experiment) -> Mission:
    design = experiment.space.decode(np.random.default_rng(3).random(experiment.space.size))
    return experiment.plan.evaluation(0, 0, design)[0]


def with_engine(wreck: Any) -> tuple[Scenario, Mission]:
    experiment = experiment_of("simulator=planar")
    return replace(experiment.scenario, simulator=Engine(wreck)), first_mission(experiment)


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_a_mission_has_the_bits_of_the_interpreted_one(engine: str) -> None:
    experiment = experiment_of(f"simulator={engine}")
    mission = first_mission(experiment)
    loops: list[Any] = []
    (outcome,), whole = run_mission(experiment.scenario, mission, watch(loops))
    (stepped,), track = run_mission(experiment.scenario, mission, run_interpreted)
    assert loops[0][0] is not run_loop
    assert repr(outcome) == repr(stepped)
    assert whole.tobytes() == track.tobytes()


@pytest.mark.parametrize("count", [1, 7])
@pytest.mark.parametrize("call", ["observe", "sense", "advance"])
def test_an_error_of_the_engine_ends_the_mission_as_in_the_interpreted_loop(
    call: str, count: int
) -> None:
    said = []
    for loop in (run_call, run_interpreted):
        wreck = Wreck(call, count)
        scenario, mission = with_engine(wreck)
        (outcome,), rows = run_mission(scenario, mission, loop)
        said.append((outcome, len(rows), wreck.calls))
        assert outcome.ended == SIMULATION_FAILURE
        assert wreck.calls.count(call) == count
    assert repr(said[0]) == repr(said[1])


@pytest.mark.parametrize("call", ["observe", "sense", "advance"])
def test_other_errors_reach_the_caller(call: str) -> None:
    scenario, mission = with_engine(Wreck(call, 3, ZeroDivisionError("of a part")))
    with pytest.raises(ZeroDivisionError, match="of a part"):
        run_mission(scenario, mission)


@dataclass
class Swerving(LiveController):
    """A live controller and its pilot, which may do something at its nth exchange."""

    act: Callable[[], object] = lambda: None
    count: int = 3
    exchanges: int = 0
    period_s = 0.1
    modes = ("driving", "swerving")
    localization: dict[str, Any] = field(default_factory=dict)
    files = ()

    @contextmanager
    def launch(self, briefing: Briefing) -> Iterator[Any]:
        self.exchanges = 0
        yield self

    def exchange(
        self, time: float, state: Array, leg: Array, readings: Array, command: Array
    ) -> int:
        self.exchanges += 1
        if self.exchanges == self.count:
            self.act()
        assert type(time) is float  # as programs print it
        mode = self.exchanges % 3
        command[DRIVE_SPEED] += 0.01 * (mode > 0)
        command[STEERING] = 0.01 * float(readings[0]) + 0.001 * time - 0.01 * float(state[YAW])
        return mode


@pytest.mark.parametrize("simulator", ["planar", "mujoco"])
def test_a_live_controller_drives_compiled_missions_as_interpreted_ones(simulator: str) -> None:
    experiment = experiment_of(f"simulator={simulator}")
    scenario = with_parts(experiment.scenario, controller=Swerving())
    mission, loops = first_mission(experiment), list[Any]()
    (outcome,), whole = run_mission(scenario, mission, watch(loops))
    (stepped,), track = run_mission(scenario, mission, run_interpreted)
    assert loops[0][0] is not run_loop
    assert set(whole[:, 6].tolist()) == {0.0, 1.0, 2.0}
    assert repr(outcome) == repr(stepped)
    assert whole.tobytes() == track.tobytes()


def test_a_layer_in_python_is_given_the_values_of_its_robot() -> None:
    """The values of all robots are the whole arrays."""
    sizes = {"poses": STATE_SIZE, "legs": LEG_SIZE, "commands": COMMAND_SIZE}
    arrays = {name: np.arange(3.0 * size) for name, size in sizes.items()}
    arrays["readings"], agents = np.arange(6.0), SimpleNamespace(readings=[0, 1, 3, 6])
    given: list[list[float]] = [[], [], [], []]

    def rule(_: Any, __: Any, *values: Any) -> float:
        for known, value in zip(given, (*values[:3], values[4]), strict=True):
            known.extend(value)
        return 0.0

    for robot in range(3):
        all_arrays: Any = SimpleNamespace(**arrays)
        _bind_layer(cast(Any, (rule, (), ())), cast(Any, agents), all_arrays, robot, np.zeros(2))()
    whole = [arrays[name].tolist() for name in ("poses", "legs", "readings", "commands")]
    assert given == whole


def fail(error: BaseException) -> None:
    raise error


@pytest.mark.parametrize("count", [1, 7])
@pytest.mark.parametrize("simulator", ["planar", "mujoco"])
def test_an_error_of_a_live_controller_ends_the_mission_at_once(simulator: str, count: int) -> None:
    experiment = experiment_of(f"simulator={simulator}")
    mission = first_mission(experiment)
    broken = Swerving(lambda: fail(SimulationError("it answers NaN")), count)
    (outcome,), _ = run_mission(with_parts(experiment.scenario, controller=broken), mission)
    assert (outcome.ended, outcome.reason) == (SIMULATION_FAILURE, "it answers NaN")
    assert broken.exchanges == count
    lost = Swerving(lambda: fail(PilotLost("gone")), count)
    with pytest.raises(PilotLost, match="gone"):
        run_mission(with_parts(experiment.scenario, controller=lost), mission)
    assert lost.exchanges == count


def test_an_interruption_reaches_a_pilot_that_waits() -> None:
    def interrupt(signum: int, frame: Any) -> None:
        raise Interruption

    experiment = experiment_of("simulator=planar")
    hanging = Swerving(lambda: time.sleep(300.0))
    scenario, mission = (
        with_parts(experiment.scenario, controller=hanging),
        first_mission(experiment),
    )
    with on_alarm(interrupt):
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        begun = time.monotonic()
        with pytest.raises(Interruption):
            run_mission(scenario, mission)
    assert time.monotonic() - begun < 100.0


class Interruption(BaseException):
    """Stands for KeyboardInterrupt, which pytest would take for its own."""


@pytest.fixture
def lost(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Any]]:
    """Exceptions that Python could not raise.

    The garbage collector waits: hypothesis lets it call Python, where an exception is lost.
    """
    lost: list[Any] = []
    monkeypatch.setattr(sys, "unraisablehook", lost.append)
    gc.disable()
    yield lost
    gc.enable()


@contextmanager
def on_alarm(handler: Callable[[int, Any], None]) -> Iterator[None]:
    """Let a handler take SIGALRM, which pytest-timeout uses: the loops of tests must end."""
    before = signal.signal(signal.SIGALRM, handler)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("simulator", ["engine", "planar", "live"])
def test_an_interruption_does_no_harm_wherever_it_comes(simulator: str, lost: list[Any]) -> None:
    """numba would end the process if it came while arguments or results are converted."""
    arrived: list[int] = []

    def interrupt(signum: int, frame: Any) -> None:
        arrived.append(signum)
        raise Interruption

    def fly_until_interrupted(alarms: int) -> None:
        signal.setitimer(signal.ITIMER_REAL, 0.0005 + 0.0002 * alarms)
        while len(arrived) == alarms:
            run_mission(scenario, mission)

    scenario, mission = with_engine(Wreck())
    if simulator != "engine":
        scenario = experiment_of("simulator=planar").scenario
    if simulator == "live":
        scenario = with_parts(scenario, controller=Swerving())
    run_mission(scenario, mission)
    with on_alarm(interrupt):
        for alarms in range(80):
            with pytest.raises(Interruption):
                fly_until_interrupted(alarms)
    assert len(arrived) == 80
    assert not lost


def test_a_signal_that_raises_nothing_changes_nothing() -> None:
    """SIGINT in a worker is such a signal: the whole group of processes gets it."""
    arrived: list[int] = []
    plain = run_mission(*with_engine(Wreck()))
    with on_alarm(lambda signum, frame: arrived.append(signum)):
        signal.setitimer(signal.ITIMER_REAL, 0.001, 0.001)
        while not arrived:
            assert repr(run_mission(*with_engine(Wreck()))) == repr(plain)


def test_a_mission_keeps_nothing_of_its_engine() -> None:
    """Its arrays are large, so they must not wait for the garbage collector."""
    wreck = Wreck()
    gone = weakref.ref(wreck)
    gc.disable()
    try:
        run_mission(*with_engine(wreck))
        del wreck
        assert gone() is None
    finally:
        gc.enable()
