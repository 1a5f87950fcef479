"""Failure onset at a waypoint of the route."""

from dataclasses import dataclass
from typing import Annotated

from numpy.random import Generator

from evoros.base.checks import COUNT, NOT_NEGATIVE, checked
from evoros.failure.onset.protocol import Onset
from evoros.failure.protocol import Trigger


@dataclass(frozen=True)
@checked
class WaypointOnset(Onset):
    """Onset when the robot reaches a waypoint, numbered in the order of visits."""

    number: Annotated[int, COUNT] = 1  # counted from 1, including home
    delay_s: Annotated[float, NOT_NEGATIVE] = 0.0  # time from the event to the failure

    def draw(self, rng: Generator) -> tuple[Trigger, float]:
        return Trigger.at_waypoint(self.number), self.delay_s
