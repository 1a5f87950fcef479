"""A sensor that freezes."""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.filter.protocol import ENDS, Channels


@dataclass(frozen=True)
class Stuck:
    """Repeats the first sample since the onset until the end, even if that sample is silent."""

    name: ClassVar[str] = "Stuck"
    effect: ClassVar[str] = ENDS

    class Parameters(NamedTuple):
        onset: Array

    class Memory(NamedTuple):
        frozen: Array  # 1 from the onset on
        value: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Parameters, Memory]:
        """Begin with nothing frozen."""
        return self.Parameters(onset), self.Memory(np.zeros(channels.size), np.zeros(channels.size))

    @staticmethod
    def rule(parameters: Parameters, memory: Memory, values: Array, time: float) -> None:
        """Remember the value at the onset, then repeat it."""
        for i in range(len(values)):
            if time >= parameters.onset[i]:
                if memory.frozen[i] == 0.0:
                    memory.frozen[i] = 1.0
                    memory.value[i] = values[i]
                values[i] = memory.value[i]
