"""An error in proportion to the value, as wheels that are too large or that slip make it."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import NO_MEMORY, Array, RuleArrays
from evoros.base.checks import NOT_NEGATIVE, NUMBER, TEXT, checked
from evoros.filter.protocol import Channels, select_channels


@dataclass(frozen=True)
@checked
class Scale:
    """Multiplies every sample of a channel by 1 + ``mean`` + two normal deviates.

    One, with the standard deviation ``sd``, is drawn for each channel at the start of the mission;
    the other, with ``slip_sd``, for each sample. The product is clipped to the channel's limits.
    """

    name: ClassVar[str] = "Scale"
    mean: Annotated[float, NUMBER] = 0.0
    sd: Annotated[float, NOT_NEGATIVE] = 0.01
    slip_sd: Annotated[float, NOT_NEGATIVE] = 0.0
    of: Annotated[str | None, TEXT] = None  # acts on channels whose names begin so; None: on all

    def start(self, channels: Channels, onset: Array, rng: Generator) -> RuleArrays:
        """Return the factors, ``onset``, ``low``, ``high``, each (n,), and the slip; no memory."""
        onset = select_channels(channels, onset, self.of, "Scale")
        factors = 1.0 + self.mean + self.sd * rng.standard_normal(channels.size)
        limits = channels.low, channels.high
        return np.concatenate((factors, onset, *limits, [self.slip_sd])), NO_MEMORY

    @staticmethod
    def rule(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
        """Scale the values; one draw for every channel, so that no channel shifts another's."""
        n = len(values)
        slip = parameters[4 * n]
        for i in range(n):
            factor = parameters[i] + slip * rng.standard_normal()
            if time >= parameters[n + i]:
                scaled = values[i] * factor
                if scaled < parameters[2 * n + i]:
                    scaled = parameters[2 * n + i]
                elif scaled > parameters[3 * n + i]:
                    scaled = parameters[3 * n + i]
                values[i] = scaled
