"""The rover's controller: obstacle avoidance that preempts waypoint navigation."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

from numpy.random import Generator

from evoros.base.checks import POSITIVE, checked, instance_of
from evoros.controller.protocol import Layer, StartedLayer
from evoros.filter.protocol import FILTERS, Filter

if TYPE_CHECKING:
    from evoros.robot.model import Robot

A_LAYER = instance_of(Layer, "a layer of a controller (mode, rule and start)")


@dataclass(frozen=True)
@checked
class Rover:
    """Two layers: ``avoidance`` decides where it sees an obstacle, else ``navigation`` does.

    ``localization`` stands between the true pose and both layers, applied in the order of the
    mapping; empty means that the pose is known exactly.

    Raises:
        InputError: a part of the wrong kind, or a period that is not positive.
    """

    avoidance: Annotated[Layer, A_LAYER]
    navigation: Annotated[Layer, A_LAYER]
    period_s: Annotated[float, POSITIVE] = 0.1
    localization: Annotated[Mapping[str, Filter], FILTERS] = field(default_factory=dict)

    @contextmanager
    def open(
        self, robot: "Robot", rng: Callable[[str], Generator]
    ) -> Iterator[Sequence[StartedLayer]]:
        """The layers in order of precedence, started afresh for one mission."""
        layers = {"avoidance": self.avoidance, "navigation": self.navigation}
        yield [
            StartedLayer(layer.mode, layer.rule, *layer.start(robot, self.period_s, rng(name)))
            for name, layer in layers.items()
        ]
