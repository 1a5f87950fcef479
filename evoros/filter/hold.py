"""A sample-and-hold element for a source that is slower than its reader."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import POSITIVE, checked
from evoros.filter.protocol import Channels, Filter


@dataclass(frozen=True)
@checked
class Hold(Filter):
    """Samples the value in the first call of each ``period_s``, and repeats it until the next."""

    name = "Hold"
    period_s: Annotated[float, POSITIVE] = 0.5

    class Parameters(NamedTuple):
        period: float
        onset: Array

    class Memory(NamedTuple):
        period: Array  # (1,) index of the current period
        value: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Parameters, Memory]:
        memory = self.Memory(np.array([-1.0]), np.full(channels.size, math.nan))
        return self.Parameters(self.period_s, onset), memory

    @staticmethod
    def rule(parameters: Parameters, memory: Memory, values: Array, time: float) -> None:
        """Sample the values in the first call of a period; otherwise repeat the held values."""
        # The tolerance absorbs rounding errors at multiples of the period.
        period = math.floor(time / parameters.period + 1e-6)
        begins = period != memory.period[0]
        memory.period[0] = period
        for i in range(len(values)):
            if begins:
                memory.value[i] = values[i]
            elif time >= parameters.onset[i]:
                values[i] = memory.value[i]
