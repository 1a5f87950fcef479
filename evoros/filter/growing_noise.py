"""Range sensor noise that increases with distance."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, checked
from evoros.filter.protocol import Channels, Filter, add_within


@dataclass(frozen=True)
@checked
class GrowingNoise(Filter):
    """Adds a normal deviate to each sample and clips the sum to the limits.

    At range r, its standard deviation is ``sigma_m`` + ``growth_per_m`` r². ``high`` is unchanged.
    """

    name = "GrowingNoise"
    sigma_m: Annotated[float, NOT_NEGATIVE] = 0.001
    growth_per_m: Annotated[float, NOT_NEGATIVE] = 0.05

    class Parameters(NamedTuple):
        sigma: float
        growth: float
        onset: Array
        low: Array
        high: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        return self.Parameters(self.sigma_m, self.growth_per_m, onset, channels.low, channels.high)

    @staticmethod
    def rule(parameters: Parameters, rng: Generator, values: Array, time: float) -> None:
        """Add noise; random numbers are drawn for all channels, whether active or not."""
        sigma, growth, onset, low, high = parameters
        for i in range(len(values)):
            deviate = rng.standard_normal()
            if time >= onset[i]:
                noise = (sigma + growth * values[i] * values[i]) * deviate
                values[i] = add_within(values[i], noise, low[i], high[i])
