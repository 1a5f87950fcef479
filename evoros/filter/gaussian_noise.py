"""White Gaussian noise of a sensor."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, TEXT, checked
from evoros.filter.protocol import ALTERS, Channels, add_within, select_channels


@dataclass(frozen=True)
@checked
class GaussianNoise:
    """Adds an independent normal deviate to every sample and clips the sum to the limits.

    A range sensor that sees nothing reports its limit exactly, so a value that is not below
    ``high`` stays as it is.
    """

    name: ClassVar[str] = "GaussianNoise"
    effect: ClassVar[str] = ALTERS
    sigma_m: Annotated[float, NOT_NEGATIVE] = 0.005  # standard deviation, in the unit of the values
    of: Annotated[str | None, TEXT] = None  # acts on channels whose names begin so; None: on all

    class Parameters(NamedTuple):
        sigma: float
        onset: Array
        low: Array
        high: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        """Select the channels."""
        onset = select_channels(channels, onset, self.of, "GaussianNoise")
        return self.Parameters(self.sigma_m, onset, channels.low, channels.high)

    @staticmethod
    def rule(parameters: Parameters, rng: Generator, values: Array, time: float) -> None:
        """Add the noise; one draw for every channel, so that no channel shifts another's noise."""
        sigma, onset, low, high = parameters
        for i in range(len(values)):
            noise = sigma * rng.standard_normal()
            if time >= onset[i]:
                values[i] = add_within(values[i], noise, low[i], high[i])
