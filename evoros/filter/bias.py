"""A constant offset added to each channel, as a systematic sensor error."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, NUMBER, TEXT, checked
from evoros.filter.protocol import Channels, Filter, add_within, select_channels


@dataclass(frozen=True)
@checked
class Bias(Filter):
    """Adds a constant offset to each channel and clips the sum to the channel's limits.

    The offset is ``offset_m`` plus a normal deviate for each channel and mission. A value at
    ``high``, which means that nothing was seen, is unchanged.
    """

    name = "Bias"
    offset_m: Annotated[float, NUMBER] = 0.0  # mean offset, in the unit of the values
    sd_m: Annotated[float, NOT_NEGATIVE] = 0.02  # standard deviation, in the same unit
    of: Annotated[str | None, TEXT] = None  # name prefix of filtered channels; None: all channels

    class Parameters(NamedTuple):
        offset: Array
        onset: Array
        low: Array
        high: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        onset = select_channels(channels, onset, self.of, "Bias")
        offset = self.offset_m + self.sd_m * rng.standard_normal(channels.size)
        return self.Parameters(offset, onset, channels.low, channels.high)

    @staticmethod
    def rule(parameters: Parameters, values: Array, time: float) -> None:
        offset, onset, low, high = parameters
        for i in range(len(values)):
            if time >= onset[i]:
                values[i] = add_within(values[i], offset[i], low[i], high[i])
