"""Failures that are stated: these sensors at this time, to repeat a case that was found."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.checks import NOT_NEGATIVE, Rule, checked
from evoros.base.errors import InputError
from evoros.failure.protocol import Fault
from evoros.filter.protocol import A_FILTER, Channels, Filter
from evoros.filter.silence import Silence

SENSORS = Rule(
    "a list of different whole numbers of at least 0",
    lambda v: (
        isinstance(v, list | tuple)
        and all(isinstance(i, int) and not isinstance(i, bool) and i >= 0 for i in v)
        and len(set(v)) == len(v)
    ),
)


@dataclass(frozen=True)
@checked
class GivenFailure:
    """The sensors with these numbers, from 0, fail at ``time_s`` in every mission."""

    sensors: Annotated[Sequence[int], SENSORS] = ()
    time_s: Annotated[float, NOT_NEGATIVE] = 0.0
    effect: Annotated[Filter, A_FILTER] = field(default_factory=Silence)  # acts on the readings

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """Return one fault with the onsets of these sensors; none without sensors.

        Raises:
            InputError: the robot has not so many sensors.
        """
        onset = np.full(channels.size, math.inf)
        beyond = [number for number in self.sensors if number >= channels.size]
        if beyond:
            raise InputError(
                f"failure.sensors: must be numbers of the robot's sensors, 0 to "
                f"{channels.size - 1}, not {beyond[0]}; correct them"
            )
        onset[list(self.sensors)] = self.time_s
        return (Fault(self.effect, onset),) if self.sensors else ()
