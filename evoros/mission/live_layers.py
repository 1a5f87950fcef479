"""Opens either kind of controller for a mission, as the layers of the mission loop."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

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
from evoros.mission.loop import LayerStage
from evoros.mission.member import Member
from evoros.mission.pipeline import Draws
from evoros.world.course import Course


@contextmanager
def open_layers(
    member: Member, course: Course, route: Array, draws: Draws
) -> Iterator[Sequence[LayerStage]]:
    """Start the controller of a robot, which has its sensors, for one mission.

    A live controller becomes one layer for each of its modes.

    Raises:
        InputError: a layer refuses to start.
        LaunchError: a live controller cannot be started.
        PilotLost: a live controller was not ready in time.
    """
    controller, robot = member.controller, member.robot
    if not isinstance(controller, LiveController):
        with controller.open(robot, lambda name: draws(f"controller.{name}")) as layers:
            yield start_layers(layers)
        return
    seed = int(draws("controller").integers(2**32))
    briefing = Briefing(robot, course.home, route, course.acceptance_m, course.time_limit_s, seed)
    with ExitStack() as stack:
        try:
            pilot = stack.enter_context(controller.launch(briefing))
        except InputError as error:
            raise LaunchError(str(error)) from error
        yield start_layers(make_layers(pilot, controller.modes))


def start_layers(layers: Sequence[StartedLayer]) -> list[LayerStage]:
    """Pack what starts the layers; those with the same memory go on sharing it."""
    memories: dict[int, Array] = {}
    stages = []
    for layer in layers:
        stage = LayerStage(*bind(layer.rule, LAYER_ARGUMENTS, layer.started))
        kept = layer.started[1] if type(layer.started) is tuple else None
        memory = memories.setdefault(id(kept), stage.memory) if kept is not None else stage.memory
        stages.append(stage._replace(memory=memory))
    return stages


class _Exchange:
    """The last answer of a pilot."""

    def __init__(self, pilot: Pilot) -> None:
        self.pilot = pilot
        self.mode = 0


class ModeRule:
    """The rule of the layer of one mode; that of the first mode asks the pilot."""

    def __init__(self, exchange: _Exchange, number: int) -> None:
        self._exchange, self._number = exchange, number

    def __call__(
        self, state: Array, leg: Array, readings: Array, time: float, command: Array
    ) -> bool:
        """Take the decision if the pilot answered this mode."""
        exchange = self._exchange
        if self._number == 1:
            exchange.mode = exchange.pilot.exchange(time, state, leg, readings, command)
        return exchange.mode == self._number


def make_layers(pilot: Pilot, modes: Sequence[str]) -> list[StartedLayer]:
    """Return a layer for each mode, in the order of their numbers."""
    exchange, numbers = _Exchange(pilot), range(1, len(modes) + 1)
    return [StartedLayer(ModeRule(exchange, number), None) for number in numbers]
