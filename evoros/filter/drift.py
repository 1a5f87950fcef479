"""A sensor drift: an error that increases steadily with time."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, NUMBER, POSITIVE, TEXT, checked
from evoros.filter.protocol import GROWS, Channels, Filter, add_within, select_channels


@dataclass(frozen=True)
@checked
class Drift(Filter):
    """Adds an offset to each channel that increases linearly after the onset, up to a limit.

    The rate is ``rate_mps`` plus a normal deviate for each channel and mission. The sum is clipped
    to the channel's limits. A value at ``high``, which means that nothing was seen, is unchanged.
    """

    name = "Drift"
    effect = GROWS
    rate_mps: Annotated[float, NUMBER] = 0.0  # mean rate, in the unit of the values per second
    sd_mps: Annotated[float, NOT_NEGATIVE] = 0.01  # standard deviation, in the same unit
    limit_m: Annotated[float, POSITIVE] = 1.0  # maximum offset, in the unit of the values
    of: Annotated[str | None, TEXT] = None  # name prefix of filtered channels; None: all channels

    class Parameters(NamedTuple):
        rate: Array
        limit: float
        onset: Array
        low: Array
        high: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        onset = select_channels(channels, onset, self.of, "Drift")
        rate = self.rate_mps + self.sd_mps * rng.standard_normal(channels.size)
        return self.Parameters(rate, self.limit_m, onset, channels.low, channels.high)

    @staticmethod
    def rule(parameters: Parameters, values: Array, time: float) -> None:
        rate, limit, onset, low, high = parameters
        for i in range(len(values)):
            if time >= onset[i]:
                offset = min(max(rate[i] * (time - onset[i]), -limit), limit)
                values[i] = add_within(values[i], offset, low[i], high[i])
