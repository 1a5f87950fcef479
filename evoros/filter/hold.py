"""Sample and hold: a source that is slower than its reader."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import POSITIVE, checked
from evoros.filter.protocol import Channels, FilterRule


@dataclass(frozen=True)
@checked
class Hold:
    """Takes a value at each multiple of ``period_s``, or as soon after as there is a sample.

    Silence is a value too: it is held where the sample taken is silent, and missed elsewhere.
    """

    period_s: Annotated[float, POSITIVE] = 0.5

    @property
    def rule(self) -> FilterRule:
        """Repeats the value taken last."""
        return hold

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Array, Array]:
        """Parameters: period, ``onset`` (n,). Memory: number of the period, held values (n,)."""
        held = np.full(1 + channels.size, math.nan)
        held[0] = -1.0
        return np.concatenate(([self.period_s], onset)), held


def hold(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
    """Take all values when a new period has begun."""
    # A time that is a rounding error short of a multiple of the period has reached it.
    number = math.floor(time / parameters[0] + 1e-6)
    taken = number != memory[0]
    memory[0] = number
    for i in range(len(values)):
        if taken:
            memory[1 + i] = values[i]
        elif time >= parameters[1 + i]:
            values[i] = memory[1 + i]
