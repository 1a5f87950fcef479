"""A constant in place of a signal."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NUMBER, checked
from evoros.base.errors import InputError
from evoros.filter.protocol import ENDS, Channels, Filter, refuse_pose


@dataclass(frozen=True)
@checked
class Constant(Filter):
    """Replaces every value except NaN with a constant in the unit of the channel."""

    name = "Constant"
    effect = ENDS
    value: Annotated[float, NUMBER] = 0.0

    class Parameters(NamedTuple):
        value: float
        onset: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        refuse_pose(channels, "Constant")
        low, high = channels.low, channels.high
        if channels.stops is not None:
            low, high = np.maximum(low, -channels.stops), np.minimum(high, channels.stops)
        for place in np.flatnonzero(np.isfinite(onset)):
            if not low[place] - 1e-9 <= self.value <= high[place] + 1e-9:
                name = channels.names[place] if channels.names else "the channel"
                raise InputError(
                    f"Constant.value: must be from {low[place]:.4g} to {high[place]:.4g}, the "
                    f"limits of {name}, not {self.value:g}"
                )
        return self.Parameters(self.value, onset)

    @staticmethod
    def rule(parameters: Parameters, values: Array, time: float) -> None:
        """Write the constant after the onset."""
        for i in range(len(values)):
            if time >= parameters.onset[i] and not math.isnan(values[i]):
                values[i] = parameters.value
