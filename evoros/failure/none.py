"""A failure model without failures."""

from dataclasses import dataclass

from numpy.random import Generator

from evoros.failure.protocol import Failure, Fault
from evoros.filter.protocol import Channels


@dataclass(frozen=True)
class NoFailure(Failure):
    """No sensor fails."""

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        return ()
