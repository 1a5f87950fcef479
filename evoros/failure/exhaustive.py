"""All sets of sensors that can fail, one after another, to find the worst cases of a design."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

from numpy.random import Generator

from evoros.base.checks import NOT_NEGATIVES, WHOLE, check_order, checked
from evoros.failure.case import Case
from evoros.failure.protocol import Fault, make_faults
from evoros.filter.protocol import A_FILTER, Channels, Filter
from evoros.filter.silence import Silence


@dataclass(frozen=True)
@checked
class ExhaustiveFailure:
    """Each trial has its own case: a set of sensors that fail at one time, in all its missions.

    Trial 0 has the first case. Cases are in the order of the number of failed sensors, then of
    their numbers, then of ``times_s``; the case without a failure has no time. More trials than
    cases begin again.
    """

    least: Annotated[int, WHOLE] = 0  # sensors that fail
    most: Annotated[int, WHOLE] = 6  # a robot with fewer sensors loses up to all of them
    times_s: Annotated[Sequence[float], NOT_NEGATIVES] = (0.0, 40.0, 80.0)
    effect: Annotated[Filter, A_FILTER] = field(default_factory=Silence)  # acts on the readings

    def __post_init__(self) -> None:
        check_order(self, "least", "most")

    def count_cases(self, sensors: int) -> int:
        """Return the number of cases of a robot with so many sensors."""
        return sum(self._count(sensors, size) for size in self._sizes(sensors))

    def draw_case(self, channels: Channels, trial: int) -> tuple[Fault, ...]:
        """Return the fault of a trial; none if no sensor fails."""
        total = self.count_cases(channels.size)
        rank = trial % total if total else 0
        for size in self._sizes(channels.size):
            count = self._count(channels.size, size)
            if rank < count:
                return self._make(channels.size, size, rank)
            rank -= count
        return ()

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """Return the fault of a case chosen uniformly."""
        return self.draw_case(channels, int(rng.random() * self.count_cases(channels.size)))

    def _sizes(self, sensors: int) -> range:
        return range(min(self.least, sensors), min(self.most, sensors) + 1)

    def _count(self, sensors: int, size: int) -> int:
        return math.comb(sensors, size) * (len(self.times_s) if size else 1)

    def _make(self, sensors: int, size: int, rank: int) -> tuple[Fault, ...]:
        if not size:
            return ()
        rank, place = divmod(rank, len(self.times_s))
        failing = choose_set(sensors, size, rank)
        case = Case(failing, (float(self.times_s[place]),) * size)
        return make_faults(case, self.effect, sensors)


def choose_set(count: int, size: int, rank: int) -> tuple[int, ...]:
    """Return the set of ``size`` numbers below ``count`` with this rank in the order of words."""
    chosen: list[int] = []
    for item in range(count):
        missing = size - len(chosen)
        with_it = math.comb(count - item - 1, missing - 1) if missing else 0
        if rank < with_it:
            chosen.append(item)
        else:
            rank -= with_it
    return tuple(chosen)
