"""A fault after which a sensor sends no more readings."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.filter.protocol import ENDS, Channels, Filter


@dataclass(frozen=True)
class Silence(Filter):
    """Replaces each value after the onset with NaN, which means no reading."""

    name = "Silence"
    effect = ENDS

    class Parameters(NamedTuple):
        onset: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        """Return the parameters."""
        return self.Parameters(onset)

    @staticmethod
    def rule(parameters: Parameters, values: Array, time: float) -> None:
        """Write NaN after the onset."""
        for i in range(len(values)):
            if time >= parameters.onset[i]:
                values[i] = math.nan
