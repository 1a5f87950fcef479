"""White Gaussian sensor noise."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, TEXT, checked
from evoros.filter.protocol import Channels, Filter, add_within, select_channels


@dataclass(frozen=True)
@checked
class GaussianNoise(Filter):
    """Adds a normal deviate to each sample below ``high`` and clips the sum to the limits."""

    name = "GaussianNoise"
    sigma_m: Annotated[float, NOT_NEGATIVE] = 0.005  # standard deviation, in the unit of the values
    of: Annotated[str | None, TEXT] = None  # name prefix of filtered channels; None: all channels

    class Parameters(NamedTuple):
        sigma: float
        onset: Array
        low: Array
        high: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        onset = select_channels(channels, onset, self.of, "GaussianNoise")
        return self.Parameters(self.sigma_m, onset, channels.low, channels.high)

    @staticmethod
    def rule(parameters: Parameters, rng: Generator, values: Array, time: float) -> None:
        """Add noise; random numbers are drawn for all channels, whether active or not."""
        sigma, onset, low, high = parameters
        for i in range(len(values)):
            noise = sigma * rng.standard_normal()
            if time >= onset[i]:
                values[i] = add_within(values[i], noise, low[i], high[i])
