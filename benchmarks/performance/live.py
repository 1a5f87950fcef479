"""Measures what missions cost whose controller runs outside of this process.

Each row is one mission in the open: the time from the controller's start to its first decision,
the wall time of an exchange with it (median) and of a whole decision (mean), and how much faster
than real time the mission ran. What an autopilot costs by itself is measured in the same run, so
that a busy machine slows both:

    python benchmarks/performance/live.py ardupilot BINARY
    python benchmarks/performance/live.py program COMMAND [OVERRIDE ...]
    python benchmarks/performance/live.py ros1 NODE [PYTHON]
    python benchmarks/performance/live.py ros2 NODE [PYTHON]
"""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from evoros.base.arrays import COMMAND_SIZE, LEG_SIZE, STATE_SIZE, Array, X, Y
from evoros.config.compose import compose
from evoros.controller.protocol import Briefing, LiveController, Pilot
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.mission.mission import SIMULATION_FAILURE, Mission
from evoros.mission.rollout import run_mission
from evoros.plugins.ardupilot.controller import ArduPilotPilot
from evoros.sensor.protocol import Mount
from evoros.world.course import Course

LIMIT_S = 60.0
SENSORS = 6


@dataclass(frozen=True)
class Row:
    """One measurement."""

    name: str
    start_s: float
    exchange_s: float
    decisions: int
    wall_s: float
    simulated_s: float
    alone_s: float | None = None  # wall time of as many exchanges with the controller alone

    def __str__(self) -> str:
        decision_us = 1e6 * self.wall_s / self.decisions
        text = f"{self.name:18} start {self.start_s:6.3f} s, {1e6 * self.exchange_s:7.1f} us an "
        text += f"exchange, {decision_us:7.1f} us a decision, "
        text += f"{self.simulated_s / self.wall_s:6.1f} x real time"
        if self.alone_s is None:
            return text
        return f"{text}, {self.alone_s / self.wall_s:.2f} of the speed of the controller alone"


class TimedPilot:
    """A pilot that notes how long its exchanges take [s]."""

    def __init__(self, inner: Pilot, seconds: list[float]) -> None:
        self.inner, self.seconds = inner, seconds

    def exchange(
        self, time: float, state: Array, leg: Array, readings: Array, command: Array
    ) -> int:
        """Exchange with the pilot."""
        begun = perf_counter()
        mode = self.inner.exchange(time, state, leg, readings, command)
        self.seconds.append(perf_counter() - begun)
        return mode


class Timed(LiveController):
    """A live controller that notes when its missions begin; further measurements come first."""

    def __init__(
        self, inner: LiveController, alone: Callable[[Pilot, Briefing], float] | None
    ) -> None:
        self.inner, self.alone = inner, alone
        self.period_s, self.localization = inner.period_s, inner.localization
        self.launched = self.begun = 0.0
        self.alone_s: float | None = None
        self.seconds: list[float] = []

    @property
    def modes(self) -> Sequence[str]:
        """The modes of the controller."""
        return self.inner.modes

    @contextmanager
    def launch(self, briefing: Briefing) -> Iterator[Pilot]:
        """Start the controller, for the measurement alone, and for the mission."""
        if self.alone is not None:
            with self.inner.launch(briefing) as pilot:
                self.alone_s = self.alone(pilot, briefing)
        self.launched = perf_counter()
        with self.inner.launch(briefing) as pilot:
            self.begun = perf_counter()
            self.seconds.clear()
            yield TimedPilot(pilot, self.seconds)


def time_mission(
    name: str, experiment: Experiment, alone: Callable[[Pilot, Briefing], float] | None = None
) -> Row:
    """Run a mission in the open, twice, because the first one loads what it needs."""
    scenario = experiment.scenario
    (member,) = scenario.members
    assert isinstance(member.controller, LiveController)
    world = next(iter(scenario.world.values()))
    ground = tuple(body for body in world.bodies if body.is_ground)
    course: Course = replace(world.course, time_limit_s=LIMIT_S)
    controller = Timed(member.controller, alone)
    opened = {"open": replace(world, bodies=ground, course=course)}
    timed = replace(member, controller=controller)
    scenario = replace(scenario, world=opened, members=(timed,))
    yaws = np.linspace(-90.0, 90.0, SENSORS)
    mounts = tuple(Mount("sonar", "base_link", 0.1, 0.0, 0.166, yaw, 12.5) for yaw in yaws)
    mission = Mission(0, 0, Design(mounts), "open", 0, "evaluation", "benchmark")
    run_mission(scenario, mission)
    (outcome,), _ = run_mission(scenario, mission)
    wall = perf_counter() - controller.begun
    if outcome.ended == SIMULATION_FAILURE:
        sys.exit(f"live.py: {name}: the mission failed: {outcome.reason}")
    decisions = round(outcome.time_s / controller.period_s)
    start = controller.begun - controller.launched
    median = float(np.median(controller.seconds))
    return Row(name, start, median, decisions, wall, outcome.time_s, controller.alone_s)


# ArduPilot ----------------------------------------------------------------------------------

ARDUPILOT = {
    "planar, 50 Hz": ("planar", 0.02),
    "planar, 200 Hz": ("planar", 0.005),
    "planar, 400 Hz": ("planar", 0.0025),
    "pybullet, 200 Hz": ("pybullet", 0.005),
}


def measure_ardupilot(arguments: Sequence[str]) -> Iterator[Row]:
    """Measure the autopilot at several rates; alone it is told a robot that stands still."""
    (binary,) = arguments
    for name, (simulator, period) in ARDUPILOT.items():
        experiment = compose(
            [
                "world=boxes",
                f"simulator={simulator}",
                f"simulator.time_step={period}",
                "controller=ardupilot",
                f"controller.binary={binary}",
                f"controller.period_s={period}",
            ]
        ).build()
        yield time_mission(name, experiment, time_frames)


def time_frames(pilot: Pilot, briefing: Briefing) -> float:
    """Return the wall time of the frames of a mission without a simulator and a decision [s]."""
    assert isinstance(pilot, ArduPilotPilot)
    state = np.zeros(STATE_SIZE)
    state[X], state[Y] = briefing.home[:2]
    pilot.exchange(0.0, state, np.zeros(LEG_SIZE), np.ones(SENSORS), np.zeros(COMMAND_SIZE))
    begun = perf_counter()
    for _ in range(round(LIMIT_S / pilot.period_s)):
        pilot.rest()
    return perf_counter() - begun


# Programs and nodes ---------------------------------------------------------------------------


def measure_program(arguments: Sequence[str]) -> Iterator[Row]:
    """Measure a program, which a command starts."""
    command, *overrides = arguments
    choices = ["controller=program", f"controller.command={command!r}", *overrides]
    yield time_mission("program, 10 Hz", build(*choices))


def measure_ros1(arguments: Sequence[str]) -> Iterator[Row]:
    """Measure a node of ROS 1."""
    yield measure_node("ros1", *arguments)


def measure_ros2(arguments: Sequence[str]) -> Iterator[Row]:
    """Measure a node of ROS 2."""
    yield measure_node("ros2", *arguments)


def measure_node(kind: str, node: str, python: str = "/usr/bin/python3") -> Row:
    """Measure a node that a command starts; ``python`` is the one that has ROS."""
    choices = [f"controller={kind}", f"controller.nodes=[{node!r}]", f"controller.python={python}"]
    return time_mission(f"{kind}, 10 Hz", build(*choices))


def build(*overrides: str) -> Experiment:
    """Build an experiment of the planar simulator and one world."""
    return compose(["world=boxes", "simulator=planar", *overrides]).build()


KINDS: Mapping[str, Callable[[Sequence[str]], Iterator[Row]]] = {
    "ardupilot": measure_ardupilot,
    "program": measure_program,
    "ros1": measure_ros1,
    "ros2": measure_ros2,
}


def main() -> None:
    """Measure the kind that the first argument names."""
    kind, *arguments = sys.argv[1:] or [""]
    if kind not in KINDS:
        sys.exit(f"live.py: the first argument must be one of {', '.join(KINDS)}, not {kind!r}")
    if not arguments:
        sys.exit(f"live.py: {kind} must be followed by its binary or command")
    for row in KINDS[kind](arguments):
        print(row, flush=True)


if __name__ == "__main__":
    main()
