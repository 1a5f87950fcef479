"""What a failure model must offer, and the faults that it draws."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.filter.protocol import Channels, Filter


@dataclass(frozen=True)
class Fault:
    """A filter that acts on each channel from its own time on.

    The random draws of a fault go by its name; faults of one name are numbered in their order.
    """

    filter: Filter
    onset: Array  # (n,) [s], infinity: never
    name: str = ""  # empty: that of the filter's class

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", type(self.filter).__name__)


@runtime_checkable
class Failure(Protocol):
    """Chooses which sensors fail and when."""

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """The faults of one mission; ``channels`` covers all sensors of the robot."""
        ...
