"""Runs a mission: opens it, runs the loop, and computes the outcome."""

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from evoros.base.arrays import DRIVE_SPEED, STATE_SIZE, STEERING, Array
from evoros.base.errors import InputError, LaunchError, SimulationError
from evoros.failure.protocol import AT_START, Failure, Fault, draw_faults
from evoros.filter.protocol import READINGS
from evoros.mission import mission as missions
from evoros.mission.compiled_loop import run_call
from evoros.mission.inputs import ENDED, RUNNING, VISITED, LoopCall, LoopResult, Run
from evoros.mission.metrics import ENDINGS, measure
from evoros.mission.mission import STEER, TIME, Mission, Outcome, Outcomes
from evoros.mission.participant import enter, open_layers
from evoros.mission.scenario import Scenario
from evoros.mission.setup import Setup
from evoros.robot.model import Robot
from evoros.simulator.protocol import PlacedRobot, Simulation

Rollout: TypeAlias = tuple[Outcomes, Array]  # outcomes and trajectory (``Scenario.name_columns``)


class RefusedDesign(InputError):
    """A design does not fit the robots of the scenario."""


def delay_faults(faults: Sequence[Fault], time: float) -> tuple[Fault, ...]:
    """Return faults with onsets and events measured from the mission time ``time`` [s]."""
    return tuple(
        replace(fault, onset=fault.onset + time)
        if fault.trigger == AT_START
        else replace(fault, trigger=replace(fault.trigger, since_s=time))
        for fault in faults
    )


@contextmanager
def open_mission(scenario: Scenario, mission: Mission) -> Iterator["OpenMission"]:
    """Draw the random values of a mission, and start its engine and parts; stop them on exit.

    A part that refuses to start raises an InputError (RefusedDesign if the design does not fit), a
    lost controller a PilotLost, an engine that cannot simulate this a SimulationError.
    """
    try:
        members = scenario.equip(mission.design)
    except InputError as error:
        raise RefusedDesign(str(error)) from error
    course = scenario.world[mission.world].course
    participants = [enter(member, scenario.failure, course, mission) for member in members]
    placed = [PlacedRobot(one.robot, one.course.home) for one in participants]
    try:
        world = scenario.draw_world(mission.world, mission.draws, placed)
    except InputError as error:
        raise SimulationError(str(error)) from error
    with ExitStack() as stack:
        layers = [stack.enter_context(open_layers(participant)) for participant in participants]
        setup = Setup(scenario, participants, layers, world)
        simulation = stack.enter_context(scenario.simulator.open(placed, world))
        yield OpenMission(setup, simulation)


class OpenMission:
    """A started mission, which can be run as a whole or in sections."""

    def __init__(self, setup: Setup, simulation: Simulation) -> None:
        self._setup, self._simulation = setup, simulation
        self._inputs = setup.collect_inputs(simulation)
        self._result = LoopResult(-1, 0, True)
        self.is_over = False  # true once the mission waits for no more robots
        self._awaited = np.flatnonzero(setup.agents.awaited).tolist()

    @property
    def call(self) -> LoopCall:
        """The loop call for the rest of the mission, with interpreted rules."""
        setup, done = self._setup, self._result
        timing = setup.timing._replace(first=done.ticks + 1, row=done.rows)
        return LoopCall(self._inputs, setup.agents, timing, setup.arrays)

    def finish(self, result: LoopResult) -> Rollout:
        """Return the rollout for the loop's result; raise SimulationError for a NaN state."""
        self._advance(result)
        return self.outcomes(), self.trajectory

    def run(self, ticks: int | None = None, run: Run = run_call) -> None:
        """Run the next ``ticks`` ticks, the first at time 0; None: to the end of the mission."""
        if not self.is_over:
            call = self.call
            last = call.timing.limit if ticks is None else call.timing.first - 1 + ticks
            timing = call.timing._replace(last=min(call.timing.limit, last))
            self._advance(run(call._replace(timing=timing)))

    def _advance(self, result: LoopResult) -> None:
        self._result = result
        if not result.finite:
            raise SimulationError(f"the state is not finite after {self.time_s:g} s")
        ended = self._setup.arrays.counts[ENDED].tolist()
        self.is_over = all(ended[robot] != RUNNING for robot in self._awaited)

    @property
    def tick_s(self) -> float:
        """The time between two ticks [s]."""
        return self._setup.timing.tick

    @property
    def time_s(self) -> float:
        """The time [s] of the last tick run."""
        return self._result.ticks * self._setup.timing.tick

    @property
    def trajectory(self) -> Array:
        """The rows recorded so far (rows, columns); ``Scenario.name_columns`` names the columns."""
        return self._setup.arrays.trajectory[: self._result.rows]

    def outcomes(self) -> Outcomes:
        """Compute the outcome of each robot, as if the mission ended now."""
        robots = range(len(self._setup.robots))
        return tuple(measure(index, self._setup, self._result) for index in robots)

    def add_failure(self, failure: Failure) -> tuple[Fault, ...]:
        """Draw faults of the first robot, start them at the next tick, and return them."""
        robot = self._setup.robots[0]
        draws, earlier = robot.participant.draws, robot.faults
        later = (self._result.ticks + 1) * self.tick_s
        rng = draws(f"later.{len(earlier)}.failure")
        drawn = draw_faults(failure, self.robot.describe_sensors(), rng, earlier)
        added = delay_faults(drawn, later)
        self._setup.add_faults(0, added, self.state.tolist())
        self._inputs = self._setup.collect_inputs(self._simulation)
        return added

    @property
    def fails_parts(self) -> bool:
        """True if parts other than sensors of the first robot can fail."""
        return any(fault.signal != READINGS for fault in self._setup.robots[0].faults)

    @property
    def robot(self) -> Robot:
        """The first robot, with its sensors."""
        return self._setup.robots[0].participant.robot

    @property
    def readings(self) -> Array:
        """The first robot's latest readings (channels,), in the order of ``Robot.layout``."""
        return self._setup.arrays.readings[: self._setup.agents.readings[1]]

    @property
    def state(self) -> Array:
        """The true state (STATE_SIZE,) of the first robot."""
        return self._setup.arrays.states[:STATE_SIZE]

    @property
    def visited(self) -> int:
        """The number of waypoints reached by the first robot."""
        return int(self._setup.arrays.counts[VISITED, 0])

    @property
    def ended(self) -> str:
        """The ending of the first robot's mission; empty while it runs."""
        ended = int(self._setup.arrays.counts[ENDED, 0])
        return "" if ended == RUNNING else ENDINGS[ended]

    def command(self, speed: float, steering: float) -> None:
        """Set the first robot's speed [m/s] and steering [rad] until its controller decides."""
        if self._setup.arrays.driven is not self._setup.arrays.commands:
            raise InputError(
                "failure: must not affect commands, steering or drive if a scenario drives the "
                "robot; choose another failure, or let the controller drive"
            )
        if self._setup.arrays.counts[ENDED, 0] != RUNNING:
            return
        commands = self._setup.arrays.commands
        commands[DRIVE_SPEED], commands[STEERING] = speed, steering
        rows = self.trajectory
        if len(rows) and rows[-1, TIME] == self.time_s:
            rows[-1, STEER] = steering


def run_mission(scenario: Scenario, mission: Mission, run: Run = run_call) -> Rollout:
    """Run a mission, whose outcome may be a failed simulation or a rejected design.

    A part that refuses to start for another reason raises an InputError, a lost controller a
    PilotLost.
    """
    try:
        with open_mission(scenario, mission) as opened:
            return opened.finish(run(opened.call))
    except (InputError, SimulationError) as error:
        return take_failure(scenario, mission, error)


def take_failure(
    scenario: Scenario, mission: Mission, error: InputError | SimulationError
) -> Rollout:
    """Return the rollout of a mission that an error ended, if the design caused the error."""
    ended = missions.SIMULATION_FAILURE
    if isinstance(error, InputError):
        ended = missions.REFUSED
        evolved = any(part.values for part in mission.design.parts.values())
        if not isinstance(error, RefusedDesign) and (isinstance(error, LaunchError) or not evolved):
            raise error
    outcomes = failed_mission(scenario, mission, ended, str(error))
    return outcomes, empty_trajectory(scenario, mission)


def failed_mission(scenario: Scenario, mission: Mission, ended: str, reason: str) -> Outcomes:
    """Create the outcomes of a mission that could not run."""
    limit = scenario.world[mission.world].course.time_limit_s
    known: dict[str, Any] = {"touched_walkers": ()} if scenario.any_walkers else {}
    known |= {"shortest_m": math.nan} if scenario.states_shortest else {}
    return tuple(
        Outcome.failure(ended, reason, limit, sensors, price=price, **known)
        for sensors, price in scenario.count_sensors(mission.design)
    )


def empty_trajectory(scenario: Scenario, mission: Mission) -> Array:
    """Create the empty trajectory (0, columns) of a mission that could not run."""
    return np.empty((0, len(scenario.name_columns(mission.design, mission.world))))
