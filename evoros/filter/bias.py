"""A systematic error of a sensor: all its readings are too long, or too short, by one amount."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import NO_MEMORY, Array, RuleArrays
from evoros.base.checks import NOT_NEGATIVE, NUMBER, TEXT, checked
from evoros.filter.protocol import Channels, select_channels


@dataclass(frozen=True)
@checked
class Bias:
    """Adds a constant offset to each channel and clips the sum to the channel's limits.

    The offset is ``offset_m`` plus a normal deviate, drawn for each channel at the start of the
    mission. A value that is not below ``high`` stays as it is, because it means that the sensor
    sees nothing.
    """

    name: ClassVar[str] = "Bias"
    offset_m: Annotated[float, NUMBER] = 0.0  # in the unit of the values
    sd_m: Annotated[float, NOT_NEGATIVE] = 0.02  # between channels, in the unit of the values
    of: Annotated[str | None, TEXT] = None  # acts on channels whose names begin so; None: on all

    def start(self, channels: Channels, onset: Array, rng: Generator) -> RuleArrays:
        """Return the offsets, ``onset``, ``low`` and ``high``, each (n,); no memory."""
        onset = select_channels(channels, onset, self.of, "Bias")
        offsets = self.offset_m + self.sd_m * rng.standard_normal(channels.size)
        return np.concatenate((offsets, onset, channels.low, channels.high)), NO_MEMORY

    @staticmethod
    def rule(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
        """Add to each channel its own offset."""
        n = len(values)
        for i in range(n):
            value = values[i]
            high = parameters[3 * n + i]
            if value < high and time >= parameters[n + i]:
                value = value + parameters[i]
                low = parameters[2 * n + i]
                if value < low:
                    value = low
                elif value > high:
                    value = high
                values[i] = value
