"""Draws the route and faults of a robot in a mission, and starts its controller."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import A_CONTEXT, Rule, ask, check_answer, is_whole, sequence_of
from evoros.base.errors import InputError, LaunchError
from evoros.base.rng import generator
from evoros.compilation.named_rules import bind
from evoros.controller import protocol
from evoros.failure.protocol import Failure, Fault, draw_faults, make_faults
from evoros.mission.inputs import LayerStage
from evoros.mission.member import Member
from evoros.mission.mission import Mission
from evoros.mission.plan import count_round
from evoros.robot.model import Robot
from evoros.world.course import Course

Draws = Callable[[str], Generator]  # returns the random generator of the named part
_LAYERS = sequence_of(protocol.StartedLayer, "StartedLayer")
_A_PILOT = Rule("a pilot (an object with a method exchange)", lambda v: hasattr(v, "exchange"))


@dataclass(frozen=True)
class Participant:
    """A robot in a mission, with its sensors, course, route and faults."""

    member: Member
    course: Course
    route: Array  # (legs, 2) [m]
    faults: Sequence[Fault]
    draws: Draws

    @property
    def robot(self) -> Robot:
        """The robot, with its sensors."""
        return self.member.robot


def enter(member: Member, failure: Failure, course: Course, mission: Mission) -> Participant:
    """Draw the route and the faults of a robot on a course."""

    def draws(part: str) -> Generator:
        return generator(mission.draws, member.key + part)

    course, robot = member.place(course), member.robot
    turn = count_round(mission.purpose, mission.generation, mission.trial)
    route = course.route(course.goes_forward(turn, draws("course")))
    if mission.case is not None and member.meets_cases:
        faults = make_faults(failure, mission.case, len(robot.mounts))
    else:
        faults = draw_faults(failure, robot.describe_sensors(), draws("failure"))
    return Participant(member, course, route, faults, draws)


@contextmanager
def open_layers(participant: Participant) -> Iterator[Sequence[LayerStage]]:
    """Start the controller of a robot for one mission."""
    controller, draws = participant.member.controller, participant.draws
    if not isinstance(controller, protocol.LiveController):

        def rng(name: str) -> Generator:
            return draws(f"controller.{name}")

        with ask("", controller.open, A_CONTEXT, participant.robot, rng) as layers:
            yield start_layers(check_answer("", controller.open, _LAYERS, layers))
        return
    course, seed = participant.course, int(draws("controller").integers(2**32))
    limits = course.acceptance_m, course.time_limit_s
    briefing = protocol.Briefing(participant.robot, course.home, participant.route, *limits, seed)
    with ExitStack() as stack:
        try:
            launched = ask("", controller.launch, A_CONTEXT, briefing)
            pilot = stack.enter_context(launched)
            check_answer("", controller.launch, _A_PILOT, pilot)
        except InputError as error:
            raise LaunchError(str(error)) from error
        answer = np.zeros(1)  # shared by the rules of all layers
        modes = [np.array([float(mode)]) for mode in range(1, len(controller.modes) + 1)]
        rules: list[Any] = [Ask(pilot, len(modes)), *[take] * (len(modes) - 1)]
        yield [LayerStage(rule, mode, answer) for rule, mode in zip(rules, modes, strict=True)]


def start_layers(layers: Sequence[protocol.StartedLayer]) -> list[LayerStage]:
    """Pack the parameters and memories of layers; shared memories are packed only once."""
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
    """The rule of the first mode's layer, which calls the pilot."""

    def __init__(self, pilot: protocol.Pilot, modes: int) -> None:
        self._exchange = pilot.exchange
        text = f"a mode number from 0 to {modes}"
        self._rule = Rule(text, lambda v: is_whole(v) and bool(0 <= v <= modes))

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
        """Call the pilot; return True if it chose the first mode."""
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
    """Return True if the pilot last chose the mode of this layer."""
    return bool(memory[0] == parameters[0])
