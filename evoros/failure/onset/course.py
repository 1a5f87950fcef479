"""An onset along the course."""

from dataclasses import dataclass
from typing import Annotated

from numpy.random import Generator

from evoros.base.checks import NOT_NEGATIVE, check_order, checked, invalid, one_of
from evoros.base.intervals import scale
from evoros.failure.trigger import Trigger

SHARE, METRES = UNITS = "share", "m"


@dataclass(frozen=True)
@checked
class CourseOnset:
    """The robot has made a part of its route, uniform in earliest to latest.

    A leg counts by how much nearer its end is than at its start, in a straight line.
    """

    earliest: Annotated[float, NOT_NEGATIVE] = 0.25
    latest: Annotated[float, NOT_NEGATIVE] = 0.75
    unit: Annotated[str, one_of(*UNITS)] = SHARE  # of the whole route, 0 to 1; or metres

    def __post_init__(self) -> None:
        check_order(self, "earliest", "latest")
        if self.unit == SHARE and self.latest > 1:
            raise invalid(self, "latest", self.latest, "must be at most 1, the whole route")

    def draw(self, rng: Generator) -> tuple[Trigger, float]:
        """Draw the part."""
        part = scale(float(rng.random()), self.earliest, self.latest)
        make = Trigger.on_course if self.unit == SHARE else Trigger.after_distance
        return make(part), 0.0
