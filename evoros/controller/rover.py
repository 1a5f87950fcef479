"""The rover's controller: obstacle avoidance that preempts waypoint navigation."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Annotated

from numpy.random import Generator

from evoros.base.checks import POSITIVE, checked, instance_of
from evoros.compilation.named_rules import start_part
from evoros.controller.protocol import LOCALIZATION, Controller, Layer, Localizer, StartedLayer
from evoros.robot.model import Robot

A_LAYER = instance_of(Layer, "a controller layer (a subclass of evoros.parts.Layer)")


@dataclass(frozen=True)
@checked
class Rover(Controller):
    """Two layers: ``avoidance`` decides if it detects an obstacle, otherwise ``navigation``.

    Both receive the exact pose, unless entries of ``localization`` change it, in order.
    """

    avoidance: Annotated[Layer, A_LAYER]
    navigation: Annotated[Layer, A_LAYER]
    period_s: Annotated[float, POSITIVE] = 0.1
    localization: Annotated[Mapping[str, Localizer], LOCALIZATION] = field(default_factory=dict)

    @property
    def modes(self) -> tuple[str, str]:
        """The modes of the layers in order of precedence."""
        return self.avoidance.mode, self.navigation.mode

    @contextmanager
    def open(
        self, robot: Robot, rng: Callable[[str], Generator]
    ) -> Iterator[Sequence[StartedLayer]]:
        """Start the layers for one mission, in order of precedence."""
        layers = {"avoidance": self.avoidance, "navigation": self.navigation}
        yield [
            StartedLayer(layer.rule, start_part(layer.start, robot, self.period_s, rng(name)))
            for name, layer in layers.items()
        ]
