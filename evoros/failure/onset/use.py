"""Failure onset once time and driving have used up a supply."""

from dataclasses import dataclass
from typing import Annotated

from numpy.random import Generator

from evoros.base.checks import NOT_NEGATIVE, checked, invalid
from evoros.failure.onset.protocol import Onset
from evoros.failure.protocol import Trigger


@dataclass(frozen=True)
@checked
class UseOnset(Onset):
    """Onset when ``amount`` is used up, at the given rates per second and per metre driven."""

    amount: Annotated[float, NOT_NEGATIVE] = 50.0  # any unit; by default metres
    per_s: Annotated[float, NOT_NEGATIVE] = 0.0
    per_m: Annotated[float, NOT_NEGATIVE] = 1.0

    def __post_init__(self) -> None:
        if self.per_s == 0 and self.per_m == 0:
            raise invalid(self, "per_m", self.per_m, "must be above 0 if per_s is 0")

    def draw(self, rng: Generator) -> tuple[Trigger, float]:
        return Trigger.by_use(self.amount, self.per_s, self.per_m), 0.0
