"""An intermittent fault: samples are lost, one at a time or in outages."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array, RuleArrays
from evoros.base.checks import NOT_NEGATIVE, PROBABILITY, checked, one_of
from evoros.filter.protocol import Channels

SILENT, LAST = "silent", "last"


@dataclass(frozen=True)
@checked
class Dropout:
    """Starts an outage of a channel with ``probability`` at each sample outside an outage.

    If an outage has d samples and the probability is p, the share of samples that are lost in the
    long run is d p / (1 + (d - 1) p).
    """

    name: ClassVar[str] = "Dropout"
    probability: Annotated[float, PROBABILITY] = 0.1
    duration_s: Annotated[float, NOT_NEGATIVE] = 0.0  # of an outage, in whole samples, at least 1
    lost: Annotated[str, one_of(SILENT, LAST)] = SILENT  # a lost sample is NaN, or the last value

    def start(self, channels: Channels, onset: Array, rng: Generator) -> RuleArrays:
        """Return parameters and memory.

        Parameters: probability, samples of an outage, 1 to repeat the last value, ``onset`` (n,).
        Memory: remaining samples of the outage (n,), last value that arrived (n,).
        """
        samples = max(1, math.ceil(self.duration_s / channels.period - 1e-6))
        repeat = float(self.lost == LAST)
        parameters = np.concatenate(([self.probability, samples, repeat], onset))
        silence = np.full(channels.size, math.nan)
        return parameters, np.concatenate((np.zeros(channels.size), silence))

    @staticmethod
    def rule(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
        """Lose samples; one draw for every channel, so that no channel shifts another's outages."""
        n = len(values)
        probability = parameters[0]
        repeat = parameters[2] == 1.0
        for i in range(n):
            starts = rng.random() < probability
            remaining = memory[i]
            if remaining == 0.0 and starts and time >= parameters[3 + i]:
                remaining = parameters[1]
            if remaining > 0.0:
                memory[i] = remaining - 1.0
                values[i] = memory[n + i] if repeat else math.nan
            else:
                memory[n + i] = values[i]
