"""White Gaussian noise on what a sensor measures."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, checked
from evoros.filter.protocol import Channels, FilterRule


@dataclass(frozen=True)
@checked
class GaussianNoise:
    """Adds an independent normal deviate to every sample, and keeps it within the limits.

    A range sensor that sees nothing reports its limit exactly, so a value that is not below
    ``high`` stays as it is.
    """

    sigma_m: Annotated[float, NOT_NEGATIVE] = 0.005  # standard deviation, in the unit of the values

    @property
    def rule(self) -> FilterRule:
        """Adds the noise."""
        return add_noise

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Array, Array]:
        """Parameters: sigma, then ``onset``, ``low`` and ``high`` of the n channels."""
        parameters = np.concatenate(([self.sigma_m], onset, channels.low, channels.high))
        return parameters, np.zeros(0)


def add_noise(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
    """One draw for every channel, used or not: no channel's fate shifts another's noise."""
    n = len(values)
    sigma = parameters[0]
    for i in range(n):
        deviate = rng.standard_normal()
        value = values[i]
        high = parameters[2 * n + 1 + i]
        if value < high and time >= parameters[1 + i]:
            value = value + sigma * deviate
            low = parameters[n + 1 + i]
            if value < low:
                value = low
            elif value > high:
                value = high
            values[i] = value
