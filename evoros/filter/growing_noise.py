"""Noise of a range sensor that grows with the distance."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, checked
from evoros.filter.protocol import ALTERS, Channels, add_within


@dataclass(frozen=True)
@checked
class GrowingNoise:
    """Adds a normal deviate to every sample and clips the sum to the limits.

    Its standard deviation at a range r is ``sigma_m`` + ``growth_per_m`` r², as for sensors
    that triangulate. A value that is not below ``high`` stays as it is, because a range sensor that
    sees nothing reports its limit exactly.
    """

    name: ClassVar[str] = "GrowingNoise"
    effect: ClassVar[str] = ALTERS
    sigma_m: Annotated[float, NOT_NEGATIVE] = 0.001
    growth_per_m: Annotated[float, NOT_NEGATIVE] = 0.05

    class Parameters(NamedTuple):
        sigma: float
        growth: float
        onset: Array
        low: Array
        high: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        """Keep the limits of the channels."""
        return self.Parameters(self.sigma_m, self.growth_per_m, onset, channels.low, channels.high)

    @staticmethod
    def rule(parameters: Parameters, rng: Generator, values: Array, time: float) -> None:
        """Add the noise; one draw for every channel, so that no channel shifts another's noise."""
        sigma, growth, onset, low, high = parameters
        for i in range(len(values)):
            deviate = rng.standard_normal()
            if time >= onset[i]:
                noise = (sigma + growth * values[i] * values[i]) * deviate
                values[i] = add_within(values[i], noise, low[i], high[i])
