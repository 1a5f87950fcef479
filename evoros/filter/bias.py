"""A systematic error of a sensor: all its readings are too long, or too short, by one amount."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, NUMBER, TEXT, checked
from evoros.filter.protocol import ALTERS, Channels, add_within, select_channels


@dataclass(frozen=True)
@checked
class Bias:
    """Adds a constant offset to each channel and clips the sum to the channel's limits.

    The offset is ``offset_m`` plus a normal deviate, drawn for each channel at the start of the
    mission. A value that is not below ``high`` stays as it is, because it means that the sensor
    sees nothing.
    """

    name: ClassVar[str] = "Bias"
    effect: ClassVar[str] = ALTERS
    offset_m: Annotated[float, NUMBER] = 0.0  # in the unit of the values
    sd_m: Annotated[float, NOT_NEGATIVE] = 0.02  # between channels, in the unit of the values
    of: Annotated[str | None, TEXT] = None  # acts on channels whose names begin so; None: on all

    class Parameters(NamedTuple):
        offset: Array
        onset: Array
        low: Array
        high: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        """Draw the offsets."""
        onset = select_channels(channels, onset, self.of, "Bias")
        offset = self.offset_m + self.sd_m * rng.standard_normal(channels.size)
        return self.Parameters(offset, onset, channels.low, channels.high)

    @staticmethod
    def rule(parameters: Parameters, values: Array, time: float) -> None:
        """Add to each channel its own offset."""
        offset, onset, low, high = parameters
        for i in range(len(values)):
            if time >= onset[i]:
                values[i] = add_within(values[i], offset[i], low[i], high[i])
