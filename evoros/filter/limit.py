"""A filter that limits values, for example the drive speed or the steering angle."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, checked
from evoros.base.compilable import compilable
from evoros.filter.protocol import Channels, Filter, refuse_pose


@dataclass(frozen=True)
@checked
class Limit(Filter):
    """Clips each value to [-limit, limit]."""

    name = "Limit"
    limit: Annotated[float, NOT_NEGATIVE] = 0.2  # unit of the values

    class Parameters(NamedTuple):
        limit: float
        onset: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        refuse_pose(channels, "Limit")
        return self.Parameters(self.limit, onset)

    @staticmethod
    def rule(parameters: Parameters, values: Array, time: float) -> None:
        """Clip the values; NaN stays NaN."""
        for i in range(len(values)):
            if time >= parameters.onset[i]:
                values[i] = clip(values[i], parameters.limit)


@compilable
def clip(value: float, limit: float) -> float:
    """Return the value clipped to [-limit, limit]."""
    if value > limit:
        return limit
    return -limit if value < -limit else value
