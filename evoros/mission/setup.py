"""Sets up a mission: its timing, arrays, stages and loop inputs."""

import math
from collections.abc import Callable, Sequence, Set
from itertools import accumulate, chain
from typing import Any

import numpy as np

from evoros.base.arrays import COMMAND_SIZE, NO_VALUES, POSE_SIZE, STATE_SIZE, STRENGTH_SIZE, Array
from evoros.base.errors import InputError
from evoros.compilation.named_rules import name_rule
from evoros.failure.protocol import AT_START, Fault, Trigger
from evoros.filter.protocol import COMMAND, DRIVE, POSE, READINGS, STRENGTH
from evoros.mission import inputs
from evoros.mission.member import Member
from evoros.mission.mission import ROBOT_COLUMNS
from evoros.mission.participant import Participant
from evoros.mission.pipeline import Pipeline
from evoros.mission.scenario import Scenario
from evoros.mission.triggers import TRIGGER_SIZE, make_row
from evoros.simulator.protocol import RuleSimulation, Simulation
from evoros.walkers.layout import REPORT_SIZE
from evoros.world.model import World

MIN_RECORD_S = 0.05  # minimum time [s] between trajectory rows if decisions are more frequent


class Setup:
    """Everything that a mission requires except its engine; ``layers`` holds one list per robot."""

    def __init__(
        self,
        scenario: Scenario,
        participants: Sequence[Participant],
        layers: Sequence[Sequence[inputs.LayerStage]],
        world: World,
    ) -> None:
        self.world = world
        self._weakens_wheels = scenario.simulator.weakens_wheels
        self.timing, periods = _plan_ticks(scenario, participants)
        self.agents = _describe_agents(participants, layers, periods)
        walkers = 0 if world.crowd is None else len(world.crowd.names)
        self.arrays = _create_arrays(participants, self.agents, self.timing, walkers * REPORT_SIZE)
        self.clocks: list[dict[Trigger, int]] = [{} for _ in participants]
        for index, participant in enumerate(participants):
            self._extend_arrays(index, participant, participant.faults, participant.course.home)
        self.robots = self._start_robots(participants, layers)
        for index, participant in enumerate(participants):
            self._start_faults(index, participant.faults)

    def _start_robots(
        self, participants: Sequence[Participant], layers: Sequence[Sequence[inputs.LayerStage]]
    ) -> list[Pipeline]:
        arrays, readings = self.arrays, self.agents.readings
        signals = _add_up([participant.robot.signal_count for participant in participants])
        return [
            Pipeline(
                participant,
                layers[i],
                arrays.signals[signals[i] : signals[i + 1]],
                arrays.readings[readings[i] : readings[i + 1]],
                arrays.poses[i * STATE_SIZE :][:POSE_SIZE],
                self.timing.tick,
            )
            for i, participant in enumerate(participants)
        ]

    def add_faults(self, index: int, faults: Sequence[Fault], place: Sequence[float]) -> None:
        """Add faults of a robot, which is at ``place`` (x, y, ...) [m]."""
        self._extend_arrays(index, self.robots[index].participant, faults, place)
        self._start_faults(index, faults)

    def _start_faults(self, index: int, faults: Sequence[Fault]) -> None:
        if self.arrays.driven is not self.arrays.commands:
            for i, robot in enumerate(self.robots):
                robot.connect(self.arrays.commands[i * COMMAND_SIZE :][:COMMAND_SIZE])
        if faults:
            self.robots[index].add_faults(faults, self.clocks[index])

    def _extend_arrays(
        self, index: int, participant: Participant, faults: Sequence[Fault], place: Sequence[float]
    ) -> None:
        course, clocks, arrays = participant.course, self.clocks[index], self.arrays
        for trigger in dict.fromkeys(fault.trigger for fault in faults):
            if trigger != AT_START and trigger not in clocks:
                row = make_row(index, trigger, course.home, participant.route, place)
                clocks[trigger] = len(arrays.clocks)
                arrays = arrays._replace(
                    clocks=np.append(arrays.clocks, -1.0),
                    triggers=np.concatenate([arrays.triggers, np.array([row], dtype=float)]),
                )
        self.arrays = arrays._replace(driven=self._choose_driven({f.signal for f in faults}))

    def _choose_driven(self, failing: Set[str]) -> Array:
        # ``driven`` is ``commands`` unless faults act between them
        driven, commands = self.arrays.driven, self.arrays.commands
        if STRENGTH in failing:
            if not self._weakens_wheels:
                raise InputError(
                    "failure: must not affect the wheels, because this simulator does not model "
                    "weak wheels (weakens_wheels); choose another failure, for example "
                    "failure=drive, or use another simulator, for example simulator=planar"
                )
            if len(driven) == len(commands):
                return np.concatenate([driven, np.ones(self.agents.awaited.size * STRENGTH_SIZE)])
        elif failing & {COMMAND, DRIVE} and driven is commands:
            return driven.copy()
        return driven

    def collect_inputs(self, simulation: Simulation) -> inputs.LoopInputs:
        """Collect the rules of the mission; for an engine, its methods replace the motion rules."""
        stages: tuple[Any, ...] = (
            _number([robot.stages[READINGS] for robot in self.robots]),
            _number([robot.stages[POSE] for robot in self.robots]),
            tuple(layer for robot in self.robots for layer in robot.layers),
            _number(self._list_actuation()),
            len(self.robots),
        )
        if isinstance(simulation, RuleSimulation):
            arrays = simulation.parameters, simulation.memory
            _check_arrays(simulation.rules.advance, *arrays)
            return inputs.LoopInputs(*simulation.rules, *arrays, *stages)

        def observe(parameters: Array, memory: Array, state: Array) -> None:
            simulation.observe(state)

        def sense(parameters: Array, memory: Array, signals: Array) -> None:
            simulation.sense(signals)

        def advance(parameters: Array, memory: Array, command: Array, duration: float) -> None:
            simulation.advance(command, duration)

        return inputs.LoopInputs(observe, sense, advance, NO_VALUES, NO_VALUES, *stages)

    def _list_actuation(self) -> list[list[inputs.FilterStage]]:
        strengths, listed = self.arrays.driven[len(self.arrays.commands) :], []
        for index, robot in enumerate(self.robots):
            driven = self.arrays.driven[index * COMMAND_SIZE :][:COMMAND_SIZE]
            strength = strengths[index * STRENGTH_SIZE :][:STRENGTH_SIZE]
            actuation = robot.actuation
            listed.append(actuation.order(robot.stages, driven, strength) if actuation else [])
        return listed


def _number(robots: Sequence[Sequence[inputs.FilterStage]]) -> tuple[inputs.FilterStage, ...]:
    return tuple(
        stage._replace(agent=index) for index, stages in enumerate(robots) for stage in stages
    )


def _check_arrays(rule: Callable[..., object], parameters: Array, memory: Array) -> None:
    """Check the arrays of a rule, because compiled code does not check them."""
    for name, array in (("parameters", parameters), ("memory", memory)):
        fits = isinstance(array, np.ndarray) and array.dtype == np.dtype(float) and array.ndim == 1
        if not (fits and array.flags.c_contiguous and array.flags.writeable):
            raise InputError(
                f"{name_rule(rule)}: its {name} must be a contiguous, writeable, one-dimensional "
                f"float64 array, not {array!r}; create the array with np.array(..., dtype=float)"
            )


def _plan_ticks(
    scenario: Scenario, participants: Sequence[Participant]
) -> tuple[inputs.Timing, inputs.Integers]:
    """Return the timing, and the periods (2, robots) of readings and decisions in ticks."""
    steps = [_count_steps(scenario, participant.member) for participant in participants]
    common = math.gcd(*chain(*steps))
    tick = common * scenario.simulator.time_step
    periods = np.array(list(zip(*steps, strict=True))) // common
    limit = math.ceil(round(participants[0].course.time_limit_s / tick, 6))
    period = int(periods[1, 0])
    record = period * math.ceil(MIN_RECORD_S / (period * tick) - 1e-9)
    return inputs.Timing(tick, record, limit, first=0, last=limit, row=0), periods


def _describe_agents(
    participants: Sequence[Participant],
    layers: Sequence[Sequence[inputs.LayerStage]],
    periods: inputs.Integers,
) -> inputs.Agents:
    return inputs.Agents(
        acceptance=np.array([item.course.acceptance_m for item in participants], dtype=float),
        end_on_collision=np.array([item.course.end_on_collision for item in participants]),
        awaited=np.array([participant.member.scored for participant in participants]),
        sense_every=periods[0],
        decide_every=periods[1],
        routes=_add_up([len(participant.route) for participant in participants]),
        layers=_add_up(list(map(len, layers))),
        readings=_add_up([participant.robot.channel_count for participant in participants]),
        estimates=_add_up([len(item.member.pose_columns) for item in participants]),
    )


def _count_steps(scenario: Scenario, member: Member) -> tuple[int, int]:
    robot = member.robot
    decide = scenario.count_steps("controller.period_s", member.controller.period_s)
    types = {mount.sensor for mount in robot.mounts}
    periods = [scenario.count_steps(name, robot.sensors[name].period_s) for name in sorted(types)]
    return (math.gcd(*periods) if periods else decide), decide


def _add_up(sizes: Sequence[int]) -> inputs.Integers:
    return np.array(list(accumulate(sizes, initial=0)))


def _create_arrays(
    participants: Sequence[Participant], agents: inputs.Agents, timing: inputs.Timing, reports: int
) -> inputs.Arrays:
    robots = len(participants)
    commands = np.zeros(robots * COMMAND_SIZE)
    # One row per recorded time, and one at the end of each robot's mission.
    rows = timing.limit // timing.record_every + 1 + robots
    columns = 1 + robots * len(ROBOT_COLUMNS) + agents.readings[-1] + agents.estimates[-1]
    columns += reports
    counts = np.zeros((inputs.COUNTS, robots))
    counts[inputs.FIRST_COLLISION] = -1.0
    legs = [(*participant.course.home[:2], *participant.route[0]) for participant in participants]
    return inputs.Arrays(
        routes=np.concatenate([participant.route for participant in participants]),
        states=np.zeros(robots * STATE_SIZE + reports),
        poses=np.zeros(robots * STATE_SIZE),
        legs=np.array(legs, dtype=float).ravel(),
        commands=commands,
        driven=commands,
        signals=np.zeros(sum(participant.robot.signal_count for participant in participants)),
        readings=np.zeros(agents.readings[-1]),
        decisions=np.zeros(robots + agents.layers[-1]),
        counts=counts,
        clocks=np.zeros(1),
        triggers=np.zeros((0, TRIGGER_SIZE)),
        trajectory=np.empty((rows, columns)),
    )
