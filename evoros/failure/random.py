"""Independent failures: some sensors, wherever they are, fail at times of their own."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator

from evoros.errors import COUNT, NOT_NEGATIVE, check, instance_of, invalid
from evoros.filter.silence import Silence
from evoros.types import Channels, Fault, Filter


@dataclass(frozen=True)
class RandomFailure:
    """``count`` sensors, chosen uniformly, fail at times uniform in earliest_s to latest_s.

    A robot with fewer sensors loses all of them. The defaults are the treatment ``random`` of the
    2018 paper (Evo-ROS).
    """

    count: int = 1  # how many different sensors fail
    earliest_s: float = 40.0
    latest_s: float = 80.0
    effect: Filter = field(default_factory=Silence)  # what happens to the readings

    def __post_init__(self) -> None:
        check(
            self,
            count=COUNT,
            earliest_s=NOT_NEGATIVE,
            latest_s=NOT_NEGATIVE,
            effect=instance_of(Filter, "a filter"),
        )
        if self.earliest_s > self.latest_s:
            rule = f"must be at most latest_s ({self.latest_s})"
            raise invalid(self, "earliest_s", self.earliest_s, rule)

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """One fault with the onsets of all chosen sensors; none without sensors.

        Draws ``count`` choices and times, however many sensors there are: robots that share a
        generator face the same times, and equal choices where they have as many sensors.
        """
        onset = np.full(channels.size, math.inf)
        intact = list(range(channels.size))
        for _ in range(self.count):
            choice, moment = rng.random(), rng.random()
            if intact:
                failing = intact.pop(int(choice * len(intact)))
                onset[failing] = self.earliest_s + (self.latest_s - self.earliest_s) * moment
        return (Fault(self.effect, onset),) if channels.size else ()
