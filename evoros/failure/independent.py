"""Independent failures: each sensor fails with the same probability."""

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.checks import NOT_NEGATIVE, PROBABILITY, check_order, checked, scale
from evoros.failure.protocol import Failure, Fault
from evoros.filter.protocol import A_FILTER, Channels, Filter
from evoros.filter.silence import Silence


@dataclass(frozen=True)
@checked
class IndependentFailure(Failure):
    """Each sensor fails with ``probability``, at a uniform time from earliest_s to latest_s."""

    probability: Annotated[float, PROBABILITY] = 0.3  # probability per sensor and mission
    earliest_s: Annotated[float, NOT_NEGATIVE] = 0.0
    latest_s: Annotated[float, NOT_NEGATIVE] = 0.0
    effect: Annotated[Filter, A_FILTER] = field(default_factory=Silence)  # applied to the readings

    def __post_init__(self) -> None:
        check_order(self, "earliest_s", "latest_s")

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """Draw the onsets; with equal generators, sensors of equal index fail at equal times."""
        onset = np.full(channels.size, math.inf)
        for sensor in range(channels.size):
            chance, share = rng.random(), rng.random()
            if chance < self.probability:
                onset[sensor] = scale(share, self.earliest_s, self.latest_s)
        return (Fault(self.effect, onset),) if channels.size else ()
