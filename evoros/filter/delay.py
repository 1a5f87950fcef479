"""A transport delay: a value arrives some time after it was sampled."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array, RuleArrays
from evoros.base.checks import NOT_NEGATIVE, checked
from evoros.filter.protocol import Channels


@dataclass(frozen=True)
@checked
class Delay:
    """Replaces each sample by the newest one that is at least ``delay_s`` old.

    The delay is therefore rounded up to a multiple of the sampling period. Until the first sample
    arrives, its value is repeated.
    """

    name: ClassVar[str] = "Delay"
    delay_s: Annotated[float, NOT_NEGATIVE] = 0.2

    def start(self, channels: Channels, onset: Array, rng: Generator) -> RuleArrays:
        """Return (delay in samples, ``onset`` (n,)) and (calls so far, ring of samples)."""
        # In floating point 0.3 / 0.1 is slightly above 3; the tolerance ignores such an excess.
        samples = math.ceil(self.delay_s / channels.period - 1e-6)
        return np.concatenate(([samples], onset)), np.zeros(1 + samples * channels.size)

    @staticmethod
    def rule(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
        """Read the oldest sample of the ring, then store the new one in its place."""
        samples = int(parameters[0])
        if samples == 0:
            return
        n = len(values)
        calls = int(memory[0])
        memory[0] = calls + 1
        if calls == 0:
            for j in range(samples):
                for i in range(n):
                    memory[1 + j * n + i] = values[i]
        oldest = 1 + (calls % samples) * n
        for i in range(n):
            arriving = memory[oldest + i]
            memory[oldest + i] = values[i]
            if time >= parameters[1 + i]:
                values[i] = arriving
