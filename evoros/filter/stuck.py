"""A sensor that freezes."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array, RuleArrays
from evoros.filter.protocol import Channels


@dataclass(frozen=True)
class Stuck:
    """Repeats the first sample since the onset until the end, even if that sample is silent."""

    name: ClassVar[str] = "Stuck"

    def start(self, channels: Channels, onset: Array, rng: Generator) -> RuleArrays:
        """Return ``onset`` (n,), and as memory 1 for frozen channels (n,), their values (n,)."""
        return onset.astype(np.float64), np.zeros(2 * channels.size)

    @staticmethod
    def rule(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
        """Remember the value at the onset, then repeat it."""
        n = len(values)
        for i in range(n):
            if time >= parameters[i]:
                if memory[i] == 1.0:
                    values[i] = memory[n + i]
                else:
                    memory[i] = 1.0
                    memory[n + i] = values[i]
