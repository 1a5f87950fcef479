"""A signal that stays constant."""

from dataclasses import dataclass
from typing import NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.filter.protocol import ENDS, Channels, Filter, Held, hold_nothing


@dataclass(frozen=True)
class Stuck(Filter):
    """Repeats the first sample after the onset, even if it is NaN."""

    name = "Stuck"
    effect = ENDS

    class Parameters(NamedTuple):
        onset: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Parameters, Held]:
        """Return the onsets and an empty memory."""
        return self.Parameters(onset), hold_nothing(channels)

    @staticmethod
    def rule(parameters: Parameters, memory: Held, values: Array, time: float) -> None:
        """Store the first value after the onset, then repeat it."""
        for i in range(len(values)):
            if time >= parameters.onset[i]:
                if memory.counter[i] == 0.0:
                    memory.counter[i] = 1.0
                    memory.value[i] = values[i]
                values[i] = memory.value[i]
