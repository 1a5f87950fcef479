"""Failures of all sets of sensors, one set per trial."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

from numpy.random import Generator

from evoros.base.checks import NOT_NEGATIVES, WHOLE, check_order, checked
from evoros.failure.protocol import Case, Fault, SystematicFailure, make_faults
from evoros.filter.protocol import A_FILTER, Channels, Filter
from evoros.filter.silence import Silence


@dataclass(frozen=True)
@checked
class ExhaustiveFailure(SystematicFailure):
    """All sets of sensors, which fail together at one of the given times.

    Cases are ordered by number of failing sensors, then by sensors, then by ``times_s``. Trials use
    all cases in random order, then again in a new order.
    """

    least: Annotated[int, WHOLE] = 0  # minimum number of failing sensors
    most: Annotated[int, WHOLE] = 6  # maximum number of failing sensors, up to all sensors
    times_s: Annotated[Sequence[float], NOT_NEGATIVES] = (0.0, 40.0, 80.0)
    effect: Annotated[Filter, A_FILTER] = field(default_factory=Silence)  # applied to the readings

    def __post_init__(self) -> None:
        check_order(self, "least", "most")

    def count_cases(self, sensors: int) -> int:
        return sum(self._count(sensors, size) for size in self._sizes(sensors))

    def state_case(self, sensors: int, number: int) -> Case:
        for size in self._sizes(sensors):
            count = self._count(sensors, size)
            if number < count:
                set_rank, time = divmod(number, len(self.times_s))
                failing = choose_set(sensors, size, set_rank) if size else ()
                return Case(failing, (float(self.times_s[time]),) * size)
            number -= count
        raise ValueError(f"number must be below {self.count_cases(sensors)}")

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        number = int(rng.random() * self.count_cases(channels.size))
        return make_faults(self, self.state_case(channels.size, number), channels.size)

    def _sizes(self, sensors: int) -> range:
        return range(min(self.least, sensors), min(self.most, sensors) + 1)

    def _count(self, sensors: int, size: int) -> int:
        return math.comb(sensors, size) * (len(self.times_s) if size else 1)


def choose_set(count: int, size: int, rank: int) -> tuple[int, ...]:
    """Return the set of ``size`` numbers below ``count`` with this lexicographic rank."""
    chosen: list[int] = []
    for item in range(count):
        missing = size - len(chosen)
        with_it = math.comb(count - item - 1, missing - 1) if missing else 0
        if rank < with_it:
            chosen.append(item)
        else:
            rank -= with_it
    return tuple(chosen)
