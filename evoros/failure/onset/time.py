"""Failure onset at a mission time."""

from dataclasses import dataclass
from typing import Annotated

from numpy.random import Generator

from evoros.base.checks import NOT_NEGATIVE, check_order, checked, scale
from evoros.failure.onset.protocol import Onset
from evoros.failure.protocol import AT_START, Trigger


@dataclass(frozen=True)
@checked
class TimeOnset(Onset):
    """Onset at a mission time, drawn uniformly from earliest_s to latest_s."""

    earliest_s: Annotated[float, NOT_NEGATIVE] = 40.0
    latest_s: Annotated[float, NOT_NEGATIVE] = 80.0

    def __post_init__(self) -> None:
        check_order(self, "earliest_s", "latest_s")

    def draw(self, rng: Generator) -> tuple[Trigger, float]:
        return AT_START, scale(float(rng.random()), self.earliest_s, self.latest_s)
