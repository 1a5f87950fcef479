"""Noise of a range sensor that grows with the distance."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import NO_MEMORY, Array, RuleArrays
from evoros.base.checks import NOT_NEGATIVE, checked
from evoros.filter.protocol import Channels


@dataclass(frozen=True)
@checked
class GrowingNoise:
    """Adds a normal deviate to every sample and clips the sum to the limits.

    Its standard deviation at a range r is ``sigma_m`` + ``growth_per_m`` r², as that of sensors
    that triangulate. A value that is not below ``high`` stays as it is, because a range sensor that
    sees nothing reports its limit exactly.
    """

    name: ClassVar[str] = "GrowingNoise"
    sigma_m: Annotated[float, NOT_NEGATIVE] = 0.001
    growth_per_m: Annotated[float, NOT_NEGATIVE] = 0.05

    def start(self, channels: Channels, onset: Array, rng: Generator) -> RuleArrays:
        """Return both numbers, then ``onset``, ``low`` and ``high``, each (n,); no memory."""
        numbers = self.sigma_m, self.growth_per_m
        return np.concatenate((numbers, onset, channels.low, channels.high)), NO_MEMORY

    @staticmethod
    def rule(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
        """Add the noise; one draw for every channel, so that no channel shifts another's noise."""
        n = len(values)
        for i in range(n):
            deviate = rng.standard_normal()
            value = values[i]
            high = parameters[2 * n + 2 + i]
            if value < high and time >= parameters[2 + i]:
                sigma = parameters[0] + parameters[1] * value * value
                low = parameters[n + 2 + i]
                values[i] = min(max(value + sigma * deviate, low), high)
