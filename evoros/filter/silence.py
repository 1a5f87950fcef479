"""A sensor that no longer reports anything."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import NO_MEMORY, Array, RuleArrays
from evoros.filter.protocol import Channels


@dataclass(frozen=True)
class Silence:
    """Replaces every value since the onset by NaN, which means that there is no reading."""

    name: ClassVar[str] = "Silence"

    def start(self, channels: Channels, onset: Array, rng: Generator) -> RuleArrays:
        """Return ``onset`` (n,); no memory."""
        return onset.astype(np.float64), NO_MEMORY

    @staticmethod
    def rule(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
        """Write NaN from the onset on."""
        for i in range(len(values)):
            if time >= parameters[i]:
                values[i] = math.nan
