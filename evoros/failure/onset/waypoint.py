"""An onset at a waypoint."""

from dataclasses import dataclass
from typing import Annotated

from numpy.random import Generator

from evoros.base.checks import COUNT, NOT_NEGATIVE, checked
from evoros.failure.trigger import Trigger


@dataclass(frozen=True)
@checked
class WaypointOnset:
    """The robot reaches a waypoint of its route, in the order in which it visits them."""

    number: Annotated[int, COUNT] = 1  # from 1; home counts, too
    delay_s: Annotated[float, NOT_NEGATIVE] = 0.0  # from then to the failure

    def draw(self, rng: Generator) -> tuple[Trigger, float]:
        """Return the waypoint."""
        return Trigger.at_waypoint(self.number), self.delay_s
