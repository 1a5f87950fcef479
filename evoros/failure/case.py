"""A failure case: the sensors that fail in a mission, and their times."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from evoros.base.arrays import Array

INTACT = "intact"  # string for the case in which no sensor fails
MODEL, NOMINAL, SCREENED, CONFIRMED = "model", "nominal", "screened", "confirmed"
"""The purposes of trials: estimating the risk under the failure model, measuring the undamaged
design, finding bad cases, and confirming them."""


@dataclass(frozen=True)
class Case:
    """The indices of the failing sensors, ascending, and the time of each failure [s]."""

    sensors: tuple[int, ...] = ()
    times_s: tuple[float, ...] = ()

    @classmethod
    def of(cls, failures: Iterable[tuple[int, float]]) -> "Case":
        """Return the case of (sensor, time) pairs in any order."""
        ordered = sorted(failures)
        return cls(tuple(n for n, _ in ordered), tuple(float(time) for _, time in ordered))

    @classmethod
    def parse(cls, text: str) -> "Case":
        """Read a case from its ``text``.

        Raises:
            ValueError: it is not a case.
        """
        parts = [] if text == INTACT else [part.split("@") for part in text.split(" ")]
        return cls.of((int(sensor), float(time)) for sensor, time in parts)

    @property
    def text(self) -> str:
        """The cell of a table, for example ``0@40.0 3@52.5``; times in s."""
        pairs = zip(self.sensors, self.times_s, strict=True)
        return " ".join(f"{sensor}@{time!r}" for sensor, time in pairs) or INTACT

    def onsets(self, count: int) -> Array:
        """Return the failure times [s] of ``count`` sensors, (count,); infinity: never."""
        onset = np.full(count, math.inf)
        for sensor, time in zip(self.sensors, self.times_s, strict=True):
            if sensor < count:
                onset[sensor] = time
        return onset
