"""A transport delay: values arrive some time after they were sampled."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, checked
from evoros.filter.protocol import Channels, FilterRule


@dataclass(frozen=True)
@checked
class Delay:
    """Gives the newest sample that is at least ``delay_s`` old.

    A delay between two multiples of the sampling period therefore acts as the longer one: the
    sample in between has not arrived yet. Until the first sample arrives, its value is given.
    """

    delay_s: Annotated[float, NOT_NEGATIVE] = 0.2

    @property
    def rule(self) -> FilterRule:
        """Swaps each sample for the one that arrives now."""
        return delay

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Array, Array]:
        """Parameters: delay in samples, ``onset`` (n,). Memory: calls so far, ring of samples."""
        # 0.3 / 0.1 is a little more than 3 in floating point; such a rest is no fraction.
        samples = math.ceil(self.delay_s / channels.period - 1e-6)
        return np.concatenate(([samples], onset)), np.zeros(1 + samples * channels.size)


def delay(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
    """Read the oldest sample of the ring, then put the new one in its place."""
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
    place = 1 + (calls % samples) * n
    for i in range(n):
        arriving = memory[place + i]
        memory[place + i] = values[i]
        if time >= parameters[1 + i]:
            values[i] = arriving
