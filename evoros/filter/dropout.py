"""An intermittent fault: samples are lost, one at a time or in outages."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, PROBABILITY, checked, one_of
from evoros.filter.protocol import ALTERS, ENDS, Channels

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

    class Parameters(NamedTuple):
        probability: float
        samples: float  # of an outage
        repeats: float  # 1 to repeat the last value
        onset: Array

    class Memory(NamedTuple):
        remaining: Array  # samples of the outage
        last: Array  # value that arrived

    @property
    def effect(self) -> str:
        """``ENDS`` if every sample is lost."""
        return ENDS if self.probability == 1 else ALTERS

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Parameters, Memory]:
        """Begin outside an outage."""
        samples = max(1, math.ceil(self.duration_s / channels.period - 1e-6))
        memory = self.Memory(np.zeros(channels.size), np.full(channels.size, math.nan))
        return self.Parameters(self.probability, samples, self.lost == LAST, onset), memory

    @staticmethod
    def rule(
        parameters: Parameters, memory: Memory, rng: Generator, values: Array, time: float
    ) -> None:
        """Lose samples; one draw for every channel, so that no channel shifts another's outages."""
        for i in range(len(values)):
            starts = rng.random() < parameters.probability
            if memory.remaining[i] == 0.0 and starts and time >= parameters.onset[i]:
                memory.remaining[i] = parameters.samples
            if memory.remaining[i] > 0.0:
                memory.remaining[i] -= 1.0
                values[i] = memory.last[i] if parameters.repeats == 1.0 else math.nan
            else:
                memory.last[i] = values[i]
