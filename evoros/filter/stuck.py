"""A sensor that freezes."""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.filter.protocol import ENDS, Channels, Held, hold_nothing


@dataclass(frozen=True)
class Stuck:
    """Repeats the first sample since the onset until the end, even if that sample is silent."""

    name: ClassVar[str] = "Stuck"
    effect: ClassVar[str] = ENDS

    class Parameters(NamedTuple):
        onset: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Parameters, Held]:
        """Begin with nothing frozen."""
        return self.Parameters(onset), hold_nothing(channels)

    @staticmethod
    def rule(parameters: Parameters, memory: Held, values: Array, time: float) -> None:
        """Remember the value at the onset, then repeat it."""
        for i in range(len(values)):
            if time >= parameters.onset[i]:
                if memory.counter[i] == 0.0:
                    memory.counter[i] = 1.0
                    memory.value[i] = values[i]
                values[i] = memory.value[i]
