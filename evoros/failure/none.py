"""The undamaged robot."""

from dataclasses import dataclass

from numpy.random import Generator

from evoros.failure.protocol import Fault
from evoros.filter.protocol import Channels


@dataclass(frozen=True)
class NoFailure:
    """Nothing fails."""

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """No fault."""
        return ()
