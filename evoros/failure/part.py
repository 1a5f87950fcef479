"""Failures of the steering, drive, wheels, localization or commands."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import DRIVE_SPEED, LEFT_WHEELS, RIGHT_WHEELS, STEERING
from evoros.base.checks import PROBABILITY, checked, invalid, one_of
from evoros.failure.onset.protocol import AN_ONSET, Onset
from evoros.failure.onset.time import TimeOnset
from evoros.failure.protocol import NEVER, Failure, Fault
from evoros.filter.delay import Delay
from evoros.filter.hold import Hold
from evoros.filter.protocol import A_FILTER, COMMAND, DRIVE, POSE, STRENGTH, Channels, Filter
from evoros.filter.stuck import Stuck

SPOILED: Mapping[str, tuple[str, tuple[int, ...]]] = {
    "steering": (DRIVE, (STEERING,)),
    "drive": (DRIVE, (DRIVE_SPEED,)),
    "left_wheel": (STRENGTH, (LEFT_WHEELS,)),
    "right_wheel": (STRENGTH, (RIGHT_WHEELS,)),
    "localization": (POSE, ()),
    "commands": (COMMAND, ()),
}
"""Signal affected by each part, and indices of affected values (empty for all)."""


@dataclass(frozen=True)
@checked
class PartFailure(Failure):
    """A part of the robot fails with a probability, from the onset to the end of the mission."""

    part: Annotated[str, one_of(*SPOILED)] = "steering"
    probability: Annotated[float, PROBABILITY] = 1.0
    onset: Annotated[Onset, AN_ONSET] = field(default_factory=TimeOnset)
    effect: Annotated[Filter, A_FILTER] = field(default_factory=Stuck)  # changes the part's signal

    def __post_init__(self) -> None:
        # A wheel has full strength until it fails, so repeating earlier values has no effect.
        if SPOILED[self.part][0] == STRENGTH and isinstance(self.effect, Stuck | Hold | Delay):
            rule = "must change the strength of a wheel; choose constant, limit, drift or dropout"
            raise invalid(self, "effect", self.effect, rule)

    @property
    def parts(self) -> Sequence[str]:
        return (self.part,)

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        fails = rng.random() < self.probability
        trigger, delay = self.onset.draw(rng)
        signal, values = SPOILED[self.part]
        onset = np.array([delay if fails else NEVER])
        return (Fault(self.effect, onset, "", signal, trigger, self.part, values),)
