"""A sensor that says nothing any more."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.filter.protocol import Channels, FilterRule


@dataclass(frozen=True)
class Silence:
    """Gives NaN, which is no reading, from the onset on."""

    @property
    def rule(self) -> FilterRule:
        """Silences the channels."""
        return silence

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Array, Array]:
        """Parameters: ``onset`` (n,)."""
        return onset.astype(np.float64), np.zeros(0)


def silence(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
    """NaN from the onset on."""
    for i in range(len(values)):
        if time >= parameters[i]:
            values[i] = math.nan
