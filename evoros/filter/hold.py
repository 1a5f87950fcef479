"""Sample and hold: a source that is slower than its reader."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array, RuleArrays
from evoros.base.checks import POSITIVE, checked
from evoros.filter.protocol import Channels


@dataclass(frozen=True)
@checked
class Hold:
    """Takes a sample at each multiple of ``period_s``, or at the first call after it.

    Silence is a value too: a silent sample is held like any other, and silence between two samples
    goes unnoticed.
    """

    name: ClassVar[str] = "Hold"
    period_s: Annotated[float, POSITIVE] = 0.5

    def start(self, channels: Channels, onset: Array, rng: Generator) -> RuleArrays:
        """Return (period, ``onset`` (n,)) and (number of the period, held values (n,))."""
        held = np.full(1 + channels.size, math.nan)
        held[0] = -1.0
        return np.concatenate(([self.period_s], onset)), held

    @staticmethod
    def rule(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
        """Take all values if a new period has begun; repeat the held ones otherwise."""
        # A time that is a rounding error short of a multiple of the period has reached it.
        number = math.floor(time / parameters[0] + 1e-6)
        begins = number != memory[0]
        memory[0] = number
        for i in range(len(values)):
            if begins:
                memory[1 + i] = values[i]
            elif time >= parameters[1 + i]:
                values[i] = memory[1 + i]
