"""A sensor that goes wrong slowly: its readings drift away from what it sees."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import NO_MEMORY, Array, RuleArrays
from evoros.base.checks import NOT_NEGATIVE, NUMBER, POSITIVE, TEXT, checked
from evoros.filter.protocol import Channels, select_channels


@dataclass(frozen=True)
@checked
class Drift:
    """Adds an offset to each channel that grows steadily from the onset on, up to a limit.

    The rate is ``rate_mps`` plus a normal deviate, drawn for each channel at the start of the
    mission. The sum is clipped to the channel's limits. A value that is not below ``high`` stays as
    it is, because it means that the sensor sees nothing.
    """

    name: ClassVar[str] = "Drift"
    rate_mps: Annotated[float, NUMBER] = 0.0  # in the unit of the values per second
    sd_mps: Annotated[float, NOT_NEGATIVE] = 0.01  # between channels, in the same unit
    limit_m: Annotated[float, POSITIVE] = 1.0  # of the offset's size, in the unit of the values
    of: Annotated[str | None, TEXT] = None  # acts on channels whose names begin so; None: on all

    def start(self, channels: Channels, onset: Array, rng: Generator) -> RuleArrays:
        """Return the rates, ``onset``, ``low``, ``high``, each (n,), and the limit; no memory."""
        onset = select_channels(channels, onset, self.of, "Drift")
        rates = self.rate_mps + self.sd_mps * rng.standard_normal(channels.size)
        parameters = np.concatenate((rates, onset, channels.low, channels.high, [self.limit_m]))
        return parameters, NO_MEMORY

    @staticmethod
    def rule(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
        """Add to each channel what its rate has made since its onset."""
        n = len(values)
        limit = parameters[4 * n]
        for i in range(n):
            value, high, onset = values[i], parameters[3 * n + i], parameters[n + i]
            if value < high and time >= onset:
                offset = parameters[i] * (time - onset)
                if offset > limit:
                    offset = limit
                elif offset < -limit:
                    offset = -limit
                value = value + offset
                low = parameters[2 * n + i]
                if value < low:
                    value = low
                elif value > high:
                    value = high
                values[i] = value
