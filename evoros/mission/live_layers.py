"""Opens either kind of controller for a mission, as the layers of the mission loop."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError, LaunchError
from evoros.compilation.named_rules import bind
from evoros.controller.protocol import (
    LAYER_ARGUMENTS,
    Briefing,
    LiveController,
    Pilot,
    StartedLayer,
)
from evoros.mission.inputs import LayerStage
from evoros.mission.participant import Participant


@contextmanager
def open_layers(participant: Participant) -> Iterator[Sequence[LayerStage]]:
    """Start the controller of a robot for one mission.

    A live controller becomes one layer for each of its modes.

    Raises:
        InputError: a layer refuses to start.
        LaunchError: a live controller cannot be started.
        PilotLost: a live controller was not ready in time.
    """
    controller, draws = participant.member.controller, participant.draws
    if not isinstance(controller, LiveController):
        with controller.open(participant.robot, lambda name: draws(f"controller.{name}")) as layers:
            yield start_layers(layers)
        return
    course, seed = participant.course, int(draws("controller").integers(2**32))
    briefing = Briefing(
        participant.robot,
        course.home,
        participant.route,
        course.acceptance_m,
        course.time_limit_s,
        seed,
    )
    with ExitStack() as stack:
        try:
            pilot = stack.enter_context(controller.launch(briefing))
        except InputError as error:
            raise LaunchError(str(error)) from error
        answer = np.zeros(1)  # shared by the layers
        modes = [np.array([float(mode)]) for mode in range(1, len(controller.modes) + 1)]
        rules: list[Any] = [Ask(pilot), *[take] * (len(modes) - 1)]
        yield [LayerStage(rule, mode, answer) for rule, mode in zip(rules, modes, strict=True)]


def start_layers(layers: Sequence[StartedLayer]) -> list[LayerStage]:
    """Pack the parameters and the memory of layers, which go on sharing their memories."""
    memories: dict[int, Array] = {}
    stages = []
    for layer in layers:
        stage = LayerStage(*bind(layer.rule, LAYER_ARGUMENTS, layer.started))
        if type(layer.started) is tuple:
            memory = memories.setdefault(id(layer.started[1]), stage.memory)
            stage = stage._replace(memory=memory)
        stages.append(stage)
    return stages


class Ask:
    """The rule of the first mode's layer, which asks the pilot."""

    def __init__(self, pilot: Pilot) -> None:
        self._exchange = pilot.exchange

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
        mode = memory[0] = self._exchange(time, state, leg, readings, command)
        return mode == 1


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
