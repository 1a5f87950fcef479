"""A limit: a drive that gets no faster, a steering that turns no further."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, checked
from evoros.base.compilable import compilable
from evoros.filter.protocol import ALTERS, Channels, refuse_pose


@dataclass(frozen=True)
@checked
class Limit:
    """Clips every value to a size, on both sides of 0."""

    name: ClassVar[str] = "Limit"
    effect: ClassVar[str] = ALTERS
    limit: Annotated[float, NOT_NEGATIVE] = 0.2  # in the unit of the values

    class Parameters(NamedTuple):
        limit: float
        onset: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        """Keep the limit."""
        refuse_pose(channels, "Limit")
        return self.Parameters(self.limit, onset)

    @staticmethod
    def rule(parameters: Parameters, values: Array, time: float) -> None:
        """Clip the values; those that are silent stay so."""
        for i in range(len(values)):
            if time >= parameters.onset[i]:
                values[i] = clip(values[i], parameters.limit)


@compilable
def clip(value: float, limit: float) -> float:
    """Return the value with at most this size."""
    if value > limit:
        return limit
    return -limit if value < -limit else value
