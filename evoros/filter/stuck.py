"""A sensor that freezes."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.filter.protocol import Channels, FilterRule


@dataclass(frozen=True)
class Stuck:
    """Repeats the first sample since the onset for ever, be it silence."""

    @property
    def rule(self) -> FilterRule:
        """Repeats the value of the onset."""
        return freeze

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Array, Array]:
        """Parameters: ``onset`` (n,). Memory: 1 where frozen (n,), the values there (n,)."""
        return onset.astype(np.float64), np.zeros(2 * channels.size)


def freeze(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
    """Keep the value at the onset, then give it."""
    n = len(values)
    for i in range(n):
        if time >= parameters[i]:
            if memory[i] == 1.0:
                values[i] = memory[n + i]
            else:
                memory[i] = 1.0
                memory[n + i] = values[i]
