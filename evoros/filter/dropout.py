"""An intermittent fault that loses single samples or all samples of an outage."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, PROBABILITY, checked, one_of
from evoros.filter.protocol import ALTERS, ENDS, Channels, Filter, Held, hold_nothing


@dataclass(frozen=True)
@checked
class Dropout(Filter):
    """Starts an outage of a channel with ``probability`` at each sample outside outages.

    With d samples per outage and probability p, a share of d p / (1 + (d - 1) p) is lost.
    """

    name = "Dropout"
    probability: Annotated[float, PROBABILITY] = 0.1
    duration_s: Annotated[float, NOT_NEGATIVE] = 0.0  # duration of an outage, at least one sample
    lost: Annotated[str, one_of("silent", "last")] = "silent"  # lost samples: NaN or the last value

    class Parameters(NamedTuple):
        probability: float
        samples: float  # number of samples in an outage
        repeats: float  # 1 if lost samples repeat the last value, else 0
        onset: Array

    @property
    def effect(self) -> str:  # type: ignore[override]
        """``ENDS`` if all samples are lost, otherwise ``ALTERS``."""
        return ENDS if self.probability == 1 else ALTERS

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Parameters, Held]:
        values = self.probability, max(1, channels.samples(self.duration_s)), self.lost == "last"
        return self.Parameters(*values, onset), hold_nothing(channels)

    @staticmethod
    def rule(
        parameters: Parameters, memory: Held, rng: Generator, values: Array, time: float
    ) -> None:
        """Drop samples; random numbers are drawn for all channels, whether active or not."""
        for i in range(len(values)):
            starts = rng.random() < parameters.probability and time >= parameters.onset[i]
            # An outage continues with one sample fewer, or a new one starts.
            memory.counter[i] = max(memory.counter[i] - 1.0, 0.0) or starts * parameters.samples
            if memory.counter[i] > 0.0:
                values[i] = memory.value[i] if parameters.repeats == 1.0 else math.nan
            memory.value[i] = values[i]
