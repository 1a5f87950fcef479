"""An error proportional to the value, for example from oversized or slipping wheels."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, NUMBER, TEXT, checked
from evoros.filter.protocol import Channels, Filter, select_channels


@dataclass(frozen=True)
@checked
class Scale(Filter):
    """Multiplies each sample of a channel by 1 + ``mean`` + two normal deviates.

    The deviate with ``sd`` is constant in a mission; the deviate with ``slip_sd`` changes with each
    sample. The product is clipped to the limits. A value at ``high``, which means that nothing was
    seen, is unchanged.
    """

    name = "Scale"
    mean: Annotated[float, NUMBER] = 0.0
    sd: Annotated[float, NOT_NEGATIVE] = 0.01
    slip_sd: Annotated[float, NOT_NEGATIVE] = 0.0
    of: Annotated[str | None, TEXT] = None  # name prefix of filtered channels; None: all channels

    class Parameters(NamedTuple):
        factor: Array
        slip: float
        onset: Array
        low: Array
        high: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        onset = select_channels(channels, onset, self.of, "Scale")
        factor = 1.0 + self.mean + self.sd * rng.standard_normal(channels.size)
        return self.Parameters(factor, self.slip_sd, onset, channels.low, channels.high)

    @staticmethod
    def rule(parameters: Parameters, rng: Generator, values: Array, time: float) -> None:
        """Scale the values; random numbers are drawn for all channels, whether active or not."""
        factor, slip, onset, low, high = parameters
        for i in range(len(values)):
            scale = factor[i] + slip * rng.standard_normal()
            if time >= onset[i] and values[i] < high[i]:
                values[i] = min(max(values[i] * scale, low[i]), high[i])
