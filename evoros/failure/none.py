"""The undamaged robot."""

from dataclasses import dataclass

from numpy.random import Generator

from evoros.types import Channels, Fault


@dataclass(frozen=True)
class NoFailure:
    """Nothing fails."""

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """No fault."""
        return ()
