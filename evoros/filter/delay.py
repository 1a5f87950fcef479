"""A transport delay between sampling and arrival of a value."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array, Matrix, copy_values
from evoros.base.checks import NOT_NEGATIVE, checked
from evoros.filter.protocol import Channels, Filter


@dataclass(frozen=True)
@checked
class Delay(Filter):
    """Replaces each sample with the latest one that is at least ``delay_s`` old.

    The delay is rounded up to whole sampling periods. The first value is repeated until then.
    """

    name = "Delay"
    delay_s: Annotated[float, NOT_NEGATIVE] = 0.2

    class Parameters(NamedTuple):
        onset: Array

    class Memory(NamedTuple):
        calls: Array  # (1,)
        ring: Matrix  # (samples, n)

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Parameters, Memory]:
        ring = np.zeros((channels.samples(self.delay_s), channels.size))
        return self.Parameters(onset), self.Memory(np.zeros(1), ring)

    @staticmethod
    def rule(parameters: Parameters, memory: Memory, values: Array, time: float) -> None:
        """Read the oldest sample of the ring buffer and overwrite it with the new sample."""
        samples, calls = len(memory.ring), int(memory.calls[0])
        if samples == 0:
            return
        if calls == 0:
            for sample in range(samples):
                copy_values(values, memory.ring[sample])
        memory.calls[0] = calls + 1
        for i in range(len(values)):
            arriving = memory.ring[calls % samples, i]
            memory.ring[calls % samples, i] = values[i]
            if time >= parameters.onset[i]:
                values[i] = arriving
