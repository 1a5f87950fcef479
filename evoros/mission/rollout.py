"""One mission, from a design to its outcome."""

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import DRIVE_SPEED, STATE_SIZE, STEERING, Array
from evoros.base.errors import InputError, LaunchError, SimulationError
from evoros.failure.protocol import AT_START, Failure, Fault
from evoros.filter.protocol import READINGS
from evoros.mission import mission as missions
from evoros.mission.compiled_loop import prepare
from evoros.mission.inputs import (
    ENDED,
    RUNNING,
    VISITED,
    Loop,
    LoopCall,
    LoopInputs,
    LoopResult,
    Prepare,
)
from evoros.mission.metrics import ENDINGS, measure
from evoros.mission.mission import STEER, TIME, Mission, Outcome, Outcomes
from evoros.mission.participant import draw_faults, enter, number_faults, open_layers
from evoros.mission.scenario import Scenario
from evoros.mission.setup import Setup
from evoros.robot.model import Robot
from evoros.simulator.protocol import PlacedRobot, Simulation


class RefusedDesign(InputError):
    """The robots of a scenario cannot have a design."""


def delay_faults(faults: Sequence[Fault], time: float) -> tuple[Fault, ...]:
    """Return faults with onsets and events counted from mission time ``time`` [s]."""
    return tuple(
        replace(fault, onset=fault.onset + time)
        if fault.trigger == AT_START
        else replace(fault, trigger=replace(fault.trigger, since_s=time))
        for fault in faults
    )


@contextmanager
def open_mission(
    scenario: Scenario, mission: Mission, prepare: Prepare = prepare
) -> Iterator["OpenMission"]:
    """Open a mission.

    Raises:
        RefusedDesign: the robots cannot have their designs.
        InputError: a part refuses to start.
        PilotLost: a controller outside of this process ended or did not answer.
        SimulationError: the engine cannot simulate these robots or this world.
    """
    try:
        members = scenario.equip(mission.design)
    except InputError as error:
        raise RefusedDesign(str(error)) from error
    course = scenario.world[mission.world].course
    placed = [PlacedRobot(member.robot, member.place(course).home) for member in members]
    try:
        world = scenario.draw_world(mission.world, mission.draws, placed)
    except InputError as error:
        raise SimulationError(str(error)) from error
    participants = [enter(member, scenario.failure, world, mission) for member in members]
    with ExitStack() as stack:
        layers = [stack.enter_context(open_layers(participant)) for participant in participants]
        setup = Setup(scenario, participants, layers, world)
        simulation = stack.enter_context(scenario.simulator.open(placed, world))
        yield OpenMission(setup, simulation, prepare)


class OpenMission:
    """A running mission, which advances only in ``run``."""

    def __init__(self, setup: Setup, simulation: Simulation, prepare: Prepare) -> None:
        self._setup, self._simulation, self._prepare = setup, simulation, prepare
        self._inputs = setup.collect_inputs(simulation)
        self._prepared: tuple[Loop, LoopInputs] | None = None
        self._result = LoopResult(-1, 0, True)
        self.is_over = False  # true once every awaited robot has ended
        self._awaited = np.flatnonzero(setup.agents.awaited).tolist()

    @property
    def tick_s(self) -> float:
        """The time between two ticks [s]."""
        return self._setup.timing.tick

    @property
    def time_s(self) -> float:
        """The time of the last tick that has run [s]."""
        return self._result.ticks * self._setup.timing.tick

    @property
    def trajectory(self) -> Array:
        """The rows so far, (rows, columns); ``Scenario.name_columns`` names the columns."""
        return self._setup.arrays.trajectory[: self._result.rows]

    @property
    def call(self) -> LoopCall:
        """The arguments of the loop for the whole mission, with rules that are not compiled."""
        setup = self._setup
        return LoopCall(self._inputs, setup.agents, setup.timing, setup.arrays)

    def run(self, ticks: int | None = None) -> None:
        """Run at most ``ticks`` ticks, None for all, to the end of the mission.

        The first tick is the start, at time 0.

        Raises:
            SimulationError: the state is no longer finite, or the engine failed.
            PilotLost: a controller outside of this process ended or did not answer.
        """
        if self.is_over:
            return
        loop, inputs = self._prepared = self._prepared or self._prepare(self._inputs)
        setup, done = self._setup, self._result
        last = setup.timing.limit if ticks is None else min(setup.timing.limit, done.ticks + ticks)
        part = setup.timing._replace(first=done.ticks + 1, last=last, row=done.rows)
        self.finish(loop(inputs, setup.agents, part, setup.arrays))

    def finish(self, result: LoopResult) -> None:
        """Store the result of the loop.

        Raises:
            SimulationError: the state is no longer finite.
        """
        self._result = result
        if not result.finite:
            raise SimulationError(f"the state is not finite after {self.time_s:g} s")
        ended = self._setup.arrays.counts[ENDED].tolist()
        self.is_over = all(ended[robot] != RUNNING for robot in self._awaited)

    def outcomes(self) -> Outcomes:
        """Compute the outcome of each robot so far; a running mission counts as cut off."""
        robots = range(len(self._setup.robots))
        return tuple(measure(index, self._setup, self._result) for index in robots)

    def add_failure(self, failure: Failure) -> tuple[Fault, ...]:
        """Add faults of the first robot, effective from the next tick, and return them.

        Times and events of the model count from that tick. The columns of the trajectory do not
        change, so a localized pose is recorded only if it was before.

        Raises:
            InputError: the model has sensors that the robot lacks, a fault refuses to start, or
                wheels fail that the simulator cannot weaken.
        """
        participant, earlier = self._setup.robots[0].participant, self._setup.robots[0].faults

        def draws(name: str) -> Generator:
            return participant.draws(f"later.{len(earlier)}.{name}")

        later = (self._result.ticks + 1) * self.tick_s
        drawn = draw_faults(failure, participant.robot, draws)
        added = number_faults(delay_faults(drawn, later), earlier)
        self._setup.add_faults(0, added, self.state.tolist())
        self._inputs = self._setup.collect_inputs(self._simulation)
        self._prepared = None
        return added

    @property
    def fails_parts(self) -> bool:
        """True if parts of the first robot other than its sensors can fail."""
        return any(fault.signal != READINGS for fault in self._setup.robots[0].faults)

    @property
    def robot(self) -> Robot:
        """The first robot, with its sensors."""
        return self._setup.robots[0].participant.robot

    @property
    def readings(self) -> Array:
        """The last readings of the first robot's sensors, (channels,), as in ``Robot.layout``."""
        return self._setup.arrays.readings[: self._setup.agents.readings[1]]

    @property
    def state(self) -> Array:
        """The true state of the first robot, (STATE_SIZE,)."""
        return self._setup.arrays.states[:STATE_SIZE]

    @property
    def visited(self) -> int:
        """The number of waypoints that the first robot has reached."""
        return int(self._setup.arrays.counts[VISITED, 0])

    @property
    def ended(self) -> str:
        """The ending of the first robot's mission; empty: it is running."""
        ended = int(self._setup.arrays.counts[ENDED, 0])
        return "" if ended == RUNNING else ENDINGS[ended]

    def command(self, speed: float, steering: float) -> None:
        """Replace the first robot's command, speed [m/s] and steering [rad], until its next one.

        Raises:
            InputError: the mission has faults between commands and drives.
        """
        if self._setup.arrays.driven is not self._setup.arrays.commands:
            raise InputError(
                "failure: must leave commands, steering and drive alone if a scenario drives the "
                "robot; choose another failure, or let the controller drive"
            )
        if self._setup.arrays.counts[ENDED, 0] != RUNNING:
            return
        self._setup.arrays.commands[DRIVE_SPEED], self._setup.arrays.commands[STEERING] = (
            speed,
            steering,
        )
        rows = self.trajectory
        if len(rows) and rows[-1, TIME] == self.time_s:
            rows[-1, STEER] = steering


Rollout: TypeAlias = tuple[Outcomes, Array]
"""A mission's outcomes and trajectory (rows, columns), with ``Scenario.name_columns``."""


def run_mission(scenario: Scenario, mission: Mission, prepare: Prepare = prepare) -> Rollout:
    """Run a mission.

    A simulation failure is an outcome, because it would recur. A part's refusal of evolved values
    is an outcome, too, because other designs can still be evaluated.

    Raises:
        InputError: a part refuses to start for a reason other than an evolved value.
        PilotLost: a controller outside of this process ended or did not answer.
    """
    try:
        with open_mission(scenario, mission, prepare) as opened:
            opened.run()
            return opened.outcomes(), opened.trajectory
    except (InputError, SimulationError) as error:
        return take_failure(scenario, mission, error)


def take_failure(
    scenario: Scenario, mission: Mission, error: InputError | SimulationError
) -> Rollout:
    """Return the rollout of a mission ended by an error.

    Raises:
        InputError: the error is not due to the design.
    """
    ended = missions.SIMULATION_FAILURE
    if isinstance(error, InputError):
        ended = missions.REFUSED
        evolved = any(part.values for part in mission.design.parts.values())
        if not isinstance(error, RefusedDesign) and (isinstance(error, LaunchError) or not evolved):
            raise error
    outcomes = failed_mission(scenario, mission, ended, str(error))
    return outcomes, empty_trajectory(scenario, mission)


def failed_mission(scenario: Scenario, mission: Mission, ended: str, reason: str) -> Outcomes:
    """Create the outcomes of a mission that could not be run."""
    limit = scenario.world[mission.world].course.time_limit_s
    touched = () if scenario.any_walkers else None
    shortest = math.nan if scenario.states_shortest else None
    return tuple(
        Outcome.failure(ended, reason, limit, sensors, price, touched, shortest)
        for sensors, price in scenario.count_sensors(mission.design)
    )


def empty_trajectory(scenario: Scenario, mission: Mission) -> Array:
    """Create the trajectory of a mission that could not be run, (0, columns)."""
    return np.empty((0, len(scenario.name_columns(mission.design, mission.world))))
