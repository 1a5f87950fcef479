"""An intermittent fault: samples are lost, one at a time or in outages."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, PROBABILITY, checked, one_of
from evoros.filter.protocol import ALTERS, ENDS, Channels, Held, hold_nothing


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
    lost: Annotated[str, one_of("silent", "last")] = "silent"  # a lost sample is NaN, or the last

    class Parameters(NamedTuple):
        probability: float
        samples: float  # of an outage
        repeats: float  # 1 to repeat the last value
        onset: Array

    @property
    def effect(self) -> str:
        """``ENDS`` if every sample is lost."""
        return ENDS if self.probability == 1 else ALTERS

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Parameters, Held]:
        """Begin outside an outage."""
        values = self.probability, max(1, channels.samples(self.duration_s)), self.lost == "last"
        return self.Parameters(*values, onset), hold_nothing(channels)

    @staticmethod
    def rule(
        parameters: Parameters, memory: Held, rng: Generator, values: Array, time: float
    ) -> None:
        """Lose samples; one draw for every channel, so that no channel shifts another's outages."""
        for i in range(len(values)):
            starts = rng.random() < parameters.probability and time >= parameters.onset[i]
            # One sample of an outage less, or a new outage.
            memory.counter[i] = max(memory.counter[i] - 1.0, 0.0) or starts * parameters.samples
            if memory.counter[i] > 0.0:
                values[i] = memory.value[i] if parameters.repeats == 1.0 else math.nan
            memory.value[i] = values[i]
