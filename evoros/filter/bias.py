"""A systematic error of a sensor: too long or too short by the same amount all the time."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, NUMBER, checked
from evoros.filter.protocol import Channels, FilterRule


@dataclass(frozen=True)
@checked
class Bias:
    """Adds an offset to each channel, constant during a mission, and keeps it within the limits.

    The offset is ``offset_m`` plus a normal deviate drawn for each channel at the start. A value
    that is not below ``high`` stays as it is: the sensor sees nothing.
    """

    offset_m: Annotated[float, NUMBER] = 0.0  # in the unit of the values
    sd_m: Annotated[float, NOT_NEGATIVE] = 0.02  # between channels, in the unit of the values

    @property
    def rule(self) -> FilterRule:
        """Adds the offsets."""
        return add_offset

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Array, Array]:
        """Parameters: the offset, ``onset``, ``low`` and ``high`` of the n channels."""
        offsets = self.offset_m + self.sd_m * rng.standard_normal(channels.size)
        return np.concatenate((offsets, onset, channels.low, channels.high)), np.zeros(0)


def add_offset(
    parameters: Array, memory: Array, rng: Generator, values: Array, time: float
) -> None:
    """Add each channel's own offset."""
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
