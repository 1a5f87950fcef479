"""Sample and hold: a source that is slower than its reader."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import POSITIVE, checked
from evoros.filter.protocol import ALTERS, Channels


@dataclass(frozen=True)
@checked
class Hold:
    """Takes a sample at each multiple of ``period_s``, or at the first call after it.

    Silence is a value too: a silent sample is held like any other, and silence between two samples
    goes unnoticed.
    """

    name: ClassVar[str] = "Hold"
    effect: ClassVar[str] = ALTERS
    period_s: Annotated[float, POSITIVE] = 0.5

    class Parameters(NamedTuple):
        period: float
        onset: Array

    class Memory(NamedTuple):
        period: Array  # (1,) the number of the last one
        value: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Parameters, Memory]:
        """Begin before the first period."""
        memory = self.Memory(np.array([-1.0]), np.full(channels.size, math.nan))
        return self.Parameters(self.period_s, onset), memory

    @staticmethod
    def rule(parameters: Parameters, memory: Memory, values: Array, time: float) -> None:
        """Take all values if a new period has begun; repeat the held ones otherwise."""
        # A time that is a rounding error short of a multiple of the period has reached it.
        period = math.floor(time / parameters.period + 1e-6)
        begins = period != memory.period[0]
        memory.period[0] = period
        for i in range(len(values)):
            if begins:
                memory.value[i] = values[i]
            elif time >= parameters.onset[i]:
                values[i] = memory.value[i]
