"""A sensor that no longer reports anything."""

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.filter.protocol import ENDS, Channels


@dataclass(frozen=True)
class Silence:
    """Replaces every value since the onset by NaN, which means that there is no reading."""

    name: ClassVar[str] = "Silence"
    effect: ClassVar[str] = ENDS

    class Parameters(NamedTuple):
        onset: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        """Keep the onset."""
        return self.Parameters(onset)

    @staticmethod
    def rule(parameters: Parameters, values: Array, time: float) -> None:
        """Write NaN from the onset on."""
        for i in range(len(values)):
            if time >= parameters.onset[i]:
                values[i] = math.nan
