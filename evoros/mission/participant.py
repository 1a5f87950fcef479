"""A robot in a mission: its route, draws and faults."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import A_CONTEXT, Rule, ask, check_answer, sequence_of
from evoros.base.errors import InputError, LaunchError
from evoros.base.rng import generator
from evoros.compilation.named_rules import bind
from evoros.controller import protocol
from evoros.failure.protocol import Case, Failure, Fault, make_faults
from evoros.filter.protocol import READINGS, SIGNALS, Channels
from evoros.mission.inputs import LayerStage
from evoros.mission.member import Member
from evoros.mission.mission import Mission
from evoros.mission.plan import count_round
from evoros.robot.model import Robot
from evoros.world.course import Course
from evoros.world.model import World

Draws = Callable[[str], Generator]  # random generator of a named part
_FAULTS = sequence_of(Fault, "faults")
_LAYERS = sequence_of(protocol.StartedLayer, "StartedLayer")
_A_PILOT = Rule("a pilot (an object with exchange)", lambda v: hasattr(v, "exchange"))


@dataclass(frozen=True)
class Participant:
    """An equipped robot in the world of a mission."""

    member: Member
    course: Course
    route: Array  # (legs, 2) [m]
    faults: Sequence[Fault]
    draws: Draws

    @property
    def robot(self) -> Robot:
        """The robot, with its sensors."""
        return self.member.robot


def enter(member: Member, failure: Failure, world: World, mission: Mission) -> Participant:
    """Draw the route and the faults of a robot from its random streams."""

    def draws(part: str) -> Generator:
        return generator(mission.draws, member.key + part)

    course = member.place(world.course)
    turn = count_round(mission.purpose, mission.generation, mission.trial)
    route = course.route(course.goes_forward(turn, draws("course")))
    case = mission.case if member.meets_cases else None
    faults = number_faults(draw_faults(failure, member.robot, draws, case))
    return Participant(member, course, route, faults, draws)


def describe_sensors(robot: Robot) -> Channels:
    """Describe the sensors as failures see them, each as one value."""
    sensors = robot.mounted_sensors()
    return Channels(
        low=np.array([min(channel.low for channel in sensor.channels) for sensor in sensors]),
        high=np.array([max(channel.high for channel in sensor.channels) for sensor in sensors]),
        position=np.ascontiguousarray(robot.sensor_poses[:, :3]),
        period=min((sensor.period_s for sensor in sensors), default=0.0),
    )


def draw_faults(
    failure: Failure, robot: Robot, draws: Draws, case: Case | None = None
) -> tuple[Fault, ...]:
    """Return the faults of a stated case, or draw faults for a mission.

    Raises:
        InputError: a fault does not have one onset per sensor, affects an unknown signal, or a part
            that its model does not state.
    """
    if case is not None:
        if failure.effect is None:
            raise InputError(f"failure: must have an effect for cases; add it to {failure!r}")
        return make_faults(case, failure.effect, len(robot.mounts))
    channels, rng = describe_sensors(robot), draws("failure")
    faults: tuple[Fault, ...] = ask("failure", failure.draw, _FAULTS, channels, rng)
    for fault in faults:
        _check_fault(fault, failure, len(robot.mounts))
    return faults


def number_faults(faults: Sequence[Fault], earlier: Sequence[Fault] = ()) -> tuple[Fault, ...]:
    """Number faults of equal signal and name, after a robot's ``earlier`` ones."""
    counts = Counter((fault.signal, fault.name) for fault in earlier)
    numbered = []
    for fault in faults:
        kind = fault.signal, fault.name
        numbered.append(replace(fault, number=counts[kind]))
        counts[kind] += 1
    return tuple(numbered)


def _check_fault(fault: Fault, failure: Failure, sensors: int) -> None:
    """Check the signal, the part and the onsets of a fault."""
    name = type(failure).__name__
    if fault.signal not in SIGNALS:
        signals = ", ".join(SIGNALS)
        raise InputError(
            f"failure: {name} must spoil one of the signals {signals}, not {fault.signal!r}; "
            f"correct its draw"
        )
    onset, count = np.asarray(fault.onset), sensors if fault.signal == READINGS else 1
    if onset.shape != (count,) or onset.dtype.kind != "f" or np.isnan(onset).any():
        each = f"each of the {count} sensors" if fault.signal == READINGS else f"the {fault.part}"
        raise InputError(
            f"failure: {name} must give each fault one onset for {each} [s], infinity for never, "
            f"not {fault.onset!r}; correct its draw"
        )
    if fault.signal != READINGS and fault.part not in failure.parts:
        raise InputError(
            f"failure: the parts of {name} must include {fault.part}, which one of its faults "
            f"affects, not {list(failure.parts)}; add it to the class"
        )


@contextmanager
def open_layers(participant: Participant) -> Iterator[Sequence[LayerStage]]:
    """Start the controller of a robot for one mission.

    A live controller becomes one layer per mode.

    Raises:
        InputError: a layer refuses to start.
        LaunchError: a live controller cannot be started.
        PilotLost: a live controller was not ready in time.
    """
    controller, draws = participant.member.controller, participant.draws
    if not isinstance(controller, protocol.LiveController):

        def rng(name: str) -> Generator:
            return draws(f"controller.{name}")

        with ask("", controller.open, A_CONTEXT, participant.robot, rng) as layers:
            yield start_layers(check_answer("", controller.open, _LAYERS, layers))
        return
    course, seed = participant.course, int(draws("controller").integers(2**32))
    briefing = protocol.Briefing(
        participant.robot,
        course.home,
        participant.route,
        course.acceptance_m,
        course.time_limit_s,
        seed,
    )
    with ExitStack() as stack:
        try:
            launched = ask("", controller.launch, A_CONTEXT, briefing)
            pilot = stack.enter_context(launched)
            check_answer("", controller.launch, _A_PILOT, pilot)
        except InputError as error:
            raise LaunchError(str(error)) from error
        answer = np.zeros(1)  # shared by the layers
        modes = [np.array([float(mode)]) for mode in range(1, len(controller.modes) + 1)]
        rules: list[Any] = [Ask(pilot, len(modes)), *[take] * (len(modes) - 1)]
        yield [LayerStage(rule, mode, answer) for rule, mode in zip(rules, modes, strict=True)]


def start_layers(layers: Sequence[protocol.StartedLayer]) -> list[LayerStage]:
    """Pack the parameters and the memory of layers, and keep memories shared."""
    memories: dict[int, Array] = {}
    stages = []
    for layer in layers:
        stage = LayerStage(*bind(layer.rule, protocol.LAYER_ARGUMENTS, layer.started))
        if type(layer.started) is tuple:
            memory = memories.setdefault(id(layer.started[1]), stage.memory)
            stage = stage._replace(memory=memory)
        stages.append(stage)
    return stages


class Ask:
    """The rule of the first mode's layer, which asks the pilot."""

    def __init__(self, pilot: protocol.Pilot, modes: int) -> None:
        self._exchange = pilot.exchange
        text = f"the number of its mode, from 0 to {modes}"
        self._rule = Rule(text, lambda v: isinstance(v, int | np.integer) and bool(0 <= v <= modes))

    def __call__(
        self,
        parameters: Array,
        memory: Array,
        state: Array,
        leg: Array,
        readings: Array,
        time: float,
        command: Array,
    ) -> bool:
        """Take the decision if the pilot answers with the first mode."""
        mode = self._exchange(time, state, leg, readings, command)
        memory[0] = check_answer("", self._exchange, self._rule, mode)
        check_answer("", self._exchange, protocol.COMMAND, command)
        return bool(mode == 1)


def take(
    parameters: Array,
    memory: Array,
    state: Array,
    leg: Array,
    readings: Array,
    time: float,
    command: Array,
) -> bool:
    """Take the decision if the pilot has answered with this layer's mode."""
    return bool(memory[0] == parameters[0])
