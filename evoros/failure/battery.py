"""A failure model with a battery that runs empty."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import DRIVE_SPEED
from evoros.base.checks import NOT_NEGATIVE, POSITIVE, checked, invalid
from evoros.failure.protocol import Failure, Fault, Trigger
from evoros.filter.constant import Constant
from evoros.filter.protocol import A_FILTER, DRIVE, Channels, Filter

JOULES = 3600.0  # per watt hour


@dataclass(frozen=True)
@checked
class BatteryFailure(Failure):
    """A battery drained by idle power and driving; the drive fails when it is empty."""

    charge_wh: Annotated[float, POSITIVE] = 2.0  # mean initial charge
    sd_wh: Annotated[float, NOT_NEGATIVE] = 0.0  # standard deviation between missions
    idle_w: Annotated[float, NOT_NEGATIVE] = 15.0
    drive_j_per_m: Annotated[float, NOT_NEGATIVE] = 60.0
    effect: Annotated[Filter, A_FILTER] = field(default_factory=Constant)  # applied to the speed

    parts: ClassVar[Sequence[str]] = ("battery",)

    def __post_init__(self) -> None:
        if self.idle_w == 0 and self.drive_j_per_m == 0:
            raise invalid(self, "idle_w", self.idle_w, "must be above 0 if drive_j_per_m is 0")

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        charge = max(self.charge_wh + self.sd_wh * float(rng.standard_normal()), 0.0)
        trigger = Trigger.by_use(charge * JOULES, self.idle_w, self.drive_j_per_m)
        return (Fault(self.effect, np.zeros(1), "", DRIVE, trigger, self.parts[0], (DRIVE_SPEED,)),)
