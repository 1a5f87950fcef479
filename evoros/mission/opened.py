"""A mission that is open: it runs to its end, or part by part as a test bench outside asks."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import DRIVE_SPEED, STATE_SIZE, STEERING, Array
from evoros.base.errors import InputError, SimulationError
from evoros.failure.protocol import Failure, Fault
from evoros.filter.protocol import READINGS
from evoros.mission.fault_draws import draw_faults
from evoros.mission.inputs import ENDED, RUNNING, VISITED, LoopCall, LoopInputs, LoopResult, Prepare
from evoros.mission.later_faults import add_faults, delay_faults
from evoros.mission.live_layers import open_layers
from evoros.mission.member import Member
from evoros.mission.metrics import ENDINGS, measure
from evoros.mission.mission import Mission
from evoros.mission.outcome import STEER, TIME, Outcomes
from evoros.mission.participant import Participant, enter
from evoros.mission.scenario import Scenario
from evoros.mission.stages import collect_inputs
from evoros.mission.start import Started, start
from evoros.robot.model import Robot
from evoros.simulator.protocol import PlacedRobot
from evoros.world.model import World


@contextmanager
def open_mission(
    scenario: Scenario, members: Sequence[Member], mission: Mission, prepare: Prepare
) -> Iterator["OpenMission"]:
    """Open a mission of robots that have the sensors of their designs.

    Raises:
        InputError: a part refuses to start.
        PilotLost: a controller outside of this process ended or did not answer.
        SimulationError: the engine cannot simulate these robots or this world.
    """
    course = scenario.world[mission.world].course
    placed = [PlacedRobot(member.robot, member.place(course).home) for member in members]
    try:
        world = scenario.draw_world(mission.world, mission.draws, placed)
    except InputError as error:
        raise SimulationError(str(error)) from error
    participants = [enter(member, scenario.failure, world, mission) for member in members]
    with ExitStack() as stack:
        layers = [stack.enter_context(open_layers(participant)) for participant in participants]
        started = start(scenario, participants, layers, world)
        simulation = stack.enter_context(scenario.simulator.open(placed, world))
        inputs = collect_inputs(simulation, started.stages)
        yield OpenMission(world, participants, started, inputs, prepare)


class OpenMission:
    """A mission on its way. Nothing passes until ``run`` is called."""

    def __init__(
        self,
        world: World,
        participants: Sequence[Participant],
        started: Started,
        inputs: LoopInputs,
        prepare: Prepare,
    ) -> None:
        self._world, self._participants = world, list(participants)
        self._agents, self._timing, self._arrays = started[:3]
        self._started = started
        self._inputs, self._prepare = inputs, prepare
        self._loop: Any = None
        self._result = LoopResult(-1, 0, True)
        self._over = False
        self._awaited = np.flatnonzero(self._agents.awaited).tolist()

    @property
    def tick_s(self) -> float:
        """The time between two ticks [s]."""
        return self._timing.tick

    @property
    def time_s(self) -> float:
        """The time of the last tick that has run [s]."""
        return self._result.ticks * self._timing.tick

    @property
    def is_over(self) -> bool:
        """Whether no robot is left for which the mission goes on."""
        return self._over

    @property
    def trajectory(self) -> Array:
        """The rows so far; ``Scenario.name_columns`` names the columns."""
        return self._arrays.trajectory[: self._result.rows]

    @property
    def call(self) -> LoopCall:
        """What the loop gets, if it runs the mission as a whole; its rules are not compiled."""
        return LoopCall(self._inputs, self._agents, self._timing, self._arrays)

    def run(self, ticks: int | None = None) -> None:
        """Run so many ticks, or fewer if the mission ends before; None: to its end.

        The first tick is the start, at the time 0.

        Raises:
            SimulationError: the state is no longer finite, or the engine failed.
            PilotLost: a controller outside of this process ended or did not answer.
        """
        if self.is_over:
            return
        if self._loop is None:
            self._loop, self._prepared = self._prepare(self._inputs)
        first, limit = self._result.ticks + 1, self._timing.limit
        last = limit if ticks is None else min(limit, self._result.ticks + ticks)
        part = self._timing._replace(first=first, last=last, row=self._result.rows)
        self._result = self._loop(self._prepared, self._agents, part, self._arrays)
        if not self._result.finite:
            raise SimulationError(f"the state is not finite after {self.time_s:g} s")
        ended = self._arrays.counts[ENDED].tolist()
        self._over = all(ended[robot] != RUNNING for robot in self._awaited)

    def outcomes(self) -> Outcomes:
        """Compute the outcome of each robot so far; a mission that has not ended is cut off."""
        return tuple(
            measure(index, participant, self._started, self._result, self._world)
            for index, participant in enumerate(self._participants)
        )

    def add_failure(self, failure: Failure) -> tuple[Fault, ...]:
        """Let parts of the first robot fail from the next tick on, and return the faults.

        The model draws its times as if the mission began with that tick; so count its events. A
        trajectory gets no more columns: it has the pose as localized only if it had it before.

        Raises:
            InputError: the model has sensors that the robot lacks, a fault refuses to start, or
                wheels fail that the simulator cannot weaken.
        """
        participant = self._participants[0]
        robot, begun = participant.robot, len(participant.faults)

        def draws(name: str) -> Generator:
            return participant.draws(f"later.{begun}.{name}")

        later = (self._result.ticks + 1) * self.tick_s
        added = delay_faults(draw_faults(failure, robot, draws, 0), later)
        changed = replace(participant, faults=(*participant.faults, *added))
        self._started, self._inputs = add_faults(changed, begun, self._started, self._inputs)
        self._participants[0], self._arrays = changed, self._started.arrays
        self._loop = None  # prepared anew
        return added

    @property
    def fails_parts(self) -> bool:
        """Whether other parts of the first robot than its sensors can fail."""
        return any(fault.signal != READINGS for fault in self._participants[0].faults)

    @property
    def robot(self) -> Robot:
        """The first robot, with its sensors."""
        return self._participants[0].robot

    @property
    def readings(self) -> Array:
        """The last readings of the first robot's sensors; ``Robot.layout`` has their places."""
        return self._arrays.readings[: self._agents.readings[1]]

    @property
    def state(self) -> Array:
        """The true state of the first robot, (STATE_SIZE,)."""
        return self._arrays.states[:STATE_SIZE]

    @property
    def visited(self) -> int:
        """The number of waypoints that the first robot has reached."""
        return int(self._arrays.counts[VISITED, 0])

    @property
    def ended(self) -> str:
        """How the first robot's part of the mission has ended; empty: it goes on."""
        ended = int(self._arrays.counts[ENDED, 0])
        return "" if ended == RUNNING else ENDINGS[ended]

    def command(self, speed: float, steering: float) -> None:
        """Replace the first robot's command, speed [m/s] and steering [rad], until the next one.

        Raises:
            InputError: the mission has faults between commands and drives.
        """
        if self._arrays.driven is not self._arrays.commands:
            raise InputError(
                "failure: must leave commands, steering and drive alone if a scenario drives the "
                "robot; choose another failure, or let the controller drive"
            )
        if self._arrays.counts[ENDED, 0] != RUNNING:
            return
        self._arrays.commands[DRIVE_SPEED], self._arrays.commands[STEERING] = speed, steering
        rows = self.trajectory
        if len(rows) and rows[-1, TIME] == self.time_s:
            rows[-1, STEER] = steering
