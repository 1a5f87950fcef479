"""What a filter must offer."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeAlias, runtime_checkable

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import instance_of, mapping_of


@dataclass(frozen=True)
class Channels:
    """What a filter may know of the n values that it filters."""

    low: Array  # (n,) least value, -inf where there is none
    high: Array  # (n,) greatest value: the range of a sensor that sees nothing
    position: Array  # (n, 3) where on the robot [m], zeros for a pose
    period: float  # time between two samples [s]

    @property
    def size(self) -> int:
        """How many values."""
        return len(self.low)


FilterRule: TypeAlias = Callable[[Array, Array, Generator, Array, float], None]
"""(parameters, memory, generator, values, time [s]): changes values in place; NaN is silence."""


@runtime_checkable
class Filter(Protocol):
    """Stands between a source (sensors, localization) and the controller: noise, delay, faults."""

    @property
    def rule(self) -> FilterRule:
        """What it does to each sample."""
        ...

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Array, Array]:
        """Parameters and memory for one mission.

        ``onset`` (n,) is the time [s] from which the filter acts on each channel: zeros for an
        ordinary filter, infinity for a channel that it leaves alone.
        """
        ...


A_FILTER = instance_of(Filter, "a filter")
FILTERS = mapping_of(Filter, "filters")
