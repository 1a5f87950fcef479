"""Failure onset after the robot has covered a fraction or length of its route."""

from dataclasses import dataclass
from typing import Annotated

from numpy.random import Generator

from evoros.base.checks import NOT_NEGATIVE, check_order, checked, invalid, one_of, scale
from evoros.failure.onset.protocol import Onset
from evoros.failure.protocol import Trigger

SHARE, METRES = UNITS = "share", "m"


@dataclass(frozen=True)
@checked
class CourseOnset(Onset):
    """Onset after a fraction or length of the route, drawn uniformly from earliest to latest.

    Progress along a leg is the reduction in the straight-line distance to its end.
    """

    earliest: Annotated[float, NOT_NEGATIVE] = 0.25
    latest: Annotated[float, NOT_NEGATIVE] = 0.75
    unit: Annotated[str, one_of(*UNITS)] = SHARE  # fraction of the route, 0 to 1, or metres

    def __post_init__(self) -> None:
        check_order(self, "earliest", "latest")
        if self.unit == SHARE and self.latest > 1:
            raise invalid(self, "latest", self.latest, "must be at most 1 (the whole route)")

    def draw(self, rng: Generator) -> tuple[Trigger, float]:
        part = scale(float(rng.random()), self.earliest, self.latest)
        make = Trigger.on_course if self.unit == SHARE else Trigger.after_distance
        return make(part), 0.0
