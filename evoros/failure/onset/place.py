"""Failure onset once the robot is near a fixed place."""

from dataclasses import dataclass
from typing import Annotated

from numpy.random import Generator

from evoros.base.checks import NOT_NEGATIVE, NUMBER, POSITIVE, checked
from evoros.failure.onset.protocol import Onset
from evoros.failure.protocol import Trigger


@dataclass(frozen=True)
@checked
class PlaceOnset(Onset):
    """Onset when the robot comes within ``radius_m`` of a fixed place."""

    x_m: Annotated[float, NUMBER] = 0.0
    y_m: Annotated[float, NUMBER] = 0.0
    radius_m: Annotated[float, POSITIVE] = 1.0
    delay_s: Annotated[float, NOT_NEGATIVE] = 0.0  # time from the event to the failure

    def draw(self, rng: Generator) -> tuple[Trigger, float]:
        return Trigger.at_place(self.x_m, self.y_m, self.radius_m), self.delay_s
