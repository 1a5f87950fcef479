"""A beam mask, as scan filters use to ignore beams that hit the robot itself."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, Rule, checked, is_whole
from evoros.base.errors import InputError
from evoros.filter.protocol import ENDS, Channels, Filter, refuse_pose

SPANS = Rule(
    "a list of [first, last] beams, counted from 0",
    lambda v: (
        isinstance(v, list | tuple)
        and all(isinstance(span, list | tuple) and len(span) == 2 for span in v)
        and all(is_whole(a) and is_whole(b) and 0 <= a <= b for a, b in v)
    ),
)


@dataclass(frozen=True)
@checked
class Mask(Filter):
    """Replaces the readings of some beams of each scan with the sensor's maximum range."""

    name = "Mask"
    effect = ENDS
    scan: Annotated[int, COUNT] = 1  # number of beams per scan
    beams: Annotated[Sequence[Sequence[int]], SPANS] = ()  # intervals [first, last] of beams

    class Parameters(NamedTuple):
        masked: Array
        high: Array
        onset: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        refuse_pose(channels, "Mask")
        if channels.size % self.scan:
            raise InputError(
                f"Mask.scan: the number of readings, {channels.size}, is not a multiple of "
                f"{self.scan}; set scan to the sensor's number of beams"
            )
        last = max((span[1] for span in self.beams), default=0)
        if last >= self.scan:
            raise InputError(
                f"Mask.beams: must be below {self.scan}, not {last}; correct the range of beams, "
                "or set scan to the sensor's number of beams"
            )
        masked = np.zeros((channels.size // self.scan, self.scan))
        for first, last in self.beams:
            masked[:, first : last + 1] = 1.0
        return self.Parameters(masked.reshape(-1), channels.high, onset)

    @staticmethod
    def rule(parameters: Parameters, values: Array, time: float) -> None:
        """Write the maximum range to masked beams; NaN stays NaN."""
        for i in range(len(values)):
            if parameters.masked[i] and time >= parameters.onset[i] and not math.isnan(values[i]):
                values[i] = parameters.high[i]
