"""An intermittent fault: samples get lost, alone or in outages."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, PROBABILITY, checked, one_of
from evoros.filter.protocol import Channels, FilterRule

SILENT, LAST = "silent", "last"


@dataclass(frozen=True)
@checked
class Dropout:
    """Starts an outage of a channel with ``probability`` at each sample that is not in one.

    With an outage of d samples and probability p, the share d p / (1 + (d - 1) p) of all samples
    is lost in the long run.
    """

    probability: Annotated[float, PROBABILITY] = 0.1
    duration_s: Annotated[float, NOT_NEGATIVE] = 0.0  # of an outage, in whole samples, at least 1
    lost: Annotated[str, one_of(SILENT, LAST)] = SILENT  # readings are NaN, or the last one repeats

    @property
    def rule(self) -> FilterRule:
        """Loses samples."""
        return drop

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Array, Array]:
        """Parameters: probability, samples of an outage, 1 to keep the last value, ``onset`` (n,).

        Memory: samples left of the outage (n,), last value that arrived (n,).
        """
        samples = max(1, math.ceil(self.duration_s / channels.period - 1e-6))
        keep = float(self.lost == LAST)
        parameters = np.concatenate(([self.probability, samples, keep], onset))
        silence = np.full(channels.size, math.nan)
        return parameters, np.concatenate((np.zeros(channels.size), silence))


def drop(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
    """One draw for every channel, used or not: no channel's fate shifts another's outages."""
    n = len(values)
    probability = parameters[0]
    keep = parameters[2] == 1.0
    for i in range(n):
        starts = rng.random() < probability
        left = memory[i]
        if left == 0.0 and starts and time >= parameters[3 + i]:
            left = parameters[1]
        if left > 0.0:
            memory[i] = left - 1.0
            values[i] = memory[n + i] if keep else math.nan
        else:
            memory[n + i] = values[i]
