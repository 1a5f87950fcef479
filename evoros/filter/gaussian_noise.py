"""White Gaussian noise of a sensor."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import NO_MEMORY, Array, RuleArrays
from evoros.base.checks import NOT_NEGATIVE, TEXT, checked
from evoros.filter.protocol import Channels, select_channels


@dataclass(frozen=True)
@checked
class GaussianNoise:
    """Adds an independent normal deviate to every sample and clips the sum to the limits.

    A range sensor that sees nothing reports its limit exactly, so a value that is not below
    ``high`` stays as it is.
    """

    name: ClassVar[str] = "GaussianNoise"
    sigma_m: Annotated[float, NOT_NEGATIVE] = 0.005  # standard deviation, in the unit of the values
    of: Annotated[str | None, TEXT] = None  # acts on channels whose names begin so; None: on all

    def start(self, channels: Channels, onset: Array, rng: Generator) -> RuleArrays:
        """Return sigma, then ``onset``, ``low`` and ``high``, each (n,); no memory."""
        onset = select_channels(channels, onset, self.of, "GaussianNoise")
        parameters = np.concatenate(([self.sigma_m], onset, channels.low, channels.high))
        return parameters, NO_MEMORY

    @staticmethod
    def rule(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
        """Add the noise; one draw for every channel, so that no channel shifts another's noise."""
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
