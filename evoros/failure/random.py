"""Random failures: a fixed number of sensors fail at independent times."""

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.checks import COUNT, NOT_NEGATIVE, check_order, checked, scale
from evoros.failure.protocol import Failure, Fault
from evoros.filter.protocol import A_FILTER, Channels, Filter
from evoros.filter.silence import Silence


@dataclass(frozen=True)
@checked
class RandomFailure(Failure):
    """Failures of ``count`` random sensors, at uniform times from earliest_s to latest_s.

    A robot with fewer sensors loses all. Defaults match the 2018 paper's ``random`` (Evo-ROS).
    """

    count: Annotated[int, COUNT] = 1  # number of failing sensors
    earliest_s: Annotated[float, NOT_NEGATIVE] = 40.0
    latest_s: Annotated[float, NOT_NEGATIVE] = 80.0
    effect: Annotated[Filter, A_FILTER] = field(default_factory=Silence)  # applied to the readings

    def __post_init__(self) -> None:
        check_order(self, "earliest_s", "latest_s")

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """Draw the onsets; the number of draws does not depend on the robot."""
        onset = np.full(channels.size, math.inf)
        intact = list(range(channels.size))
        for _ in range(self.count):
            choice, share = rng.random(), rng.random()
            if intact:
                failing = intact.pop(int(choice * len(intact)))
                onset[failing] = scale(share, self.earliest_s, self.latest_s)
        return (Fault(self.effect, onset),) if channels.size else ()
