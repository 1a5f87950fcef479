"""Independent failures: some sensors, wherever they are, fail at times of their own."""

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.checks import COUNT, NOT_NEGATIVE, check_order, checked
from evoros.base.intervals import scale
from evoros.failure.protocol import Fault
from evoros.filter.protocol import A_FILTER, Channels, Filter
from evoros.filter.silence import Silence


@dataclass(frozen=True)
@checked
class RandomFailure:
    """``count`` sensors fail, chosen uniformly, at times uniform in earliest_s to latest_s.

    A robot with fewer sensors loses all of them. The defaults are the treatment ``random`` of the
    2018 paper (Evo-ROS).
    """

    count: Annotated[int, COUNT] = 1  # how many different sensors fail
    earliest_s: Annotated[float, NOT_NEGATIVE] = 40.0
    latest_s: Annotated[float, NOT_NEGATIVE] = 80.0
    effect: Annotated[Filter, A_FILTER] = field(default_factory=Silence)  # acts on the readings

    def __post_init__(self) -> None:
        check_order(self, "earliest_s", "latest_s")

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """Return one fault with the onsets of all chosen sensors; none without sensors.

        The number of sensors does not change how many choices and times are drawn: robots that
        share a generator face the same times, and the same choices if they have equally many
        sensors.
        """
        onset = np.full(channels.size, math.inf)
        intact = list(range(channels.size))
        for _ in range(self.count):
            choice, share = rng.random(), rng.random()
            if intact:
                failing = intact.pop(int(choice * len(intact)))
                onset[failing] = scale(share, self.earliest_s, self.latest_s)
        return (Fault(self.effect, onset),) if channels.size else ()
