"""Local damage: a blow hits one sensor and, with decreasing probability, those around it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import (
    NOT_NEGATIVE,
    NOT_NEGATIVES,
    PROBABILITY,
    Rule,
    check_order,
    checked,
    invalid,
)
from evoros.base.intervals import scale
from evoros.failure.protocol import Fault
from evoros.filter.protocol import A_FILTER, Channels, Filter
from evoros.filter.silence import Silence

PROBABILITIES = Rule(
    "a list of numbers from 0 to 1",
    lambda v: isinstance(v, list | tuple) and all(map(PROBABILITY.holds, v)),
)


@dataclass(frozen=True)
@checked
class SpatialFailure:
    """A sensor chosen uniformly is the centre of damage; all sensors that fail do so at one time.

    A sensor fails with the probability of the smallest radius around the centre that reaches it
    (straight distance in space), independently of the others. Beyond the last radius none fails.
    The defaults are the treatment ``spatial`` of the 2018 paper (Evo-ROS).
    """

    radii_m: Annotated[Sequence[float], NOT_NEGATIVES] = (0.03, 0.06, 0.09)  # increasing
    probabilities: Annotated[Sequence[float], PROBABILITIES] = (1.0, 2 / 3, 1 / 3)  # by radius
    earliest_s: Annotated[float, NOT_NEGATIVE] = 40.0
    latest_s: Annotated[float, NOT_NEGATIVE] = 80.0
    effect: Annotated[Filter, A_FILTER] = field(default_factory=Silence)  # acts on the readings

    def __post_init__(self) -> None:
        check_order(self, "earliest_s", "latest_s")
        radii, probabilities = self.radii_m, self.probabilities
        if any(radii[k] >= radii[k + 1] for k in range(len(radii) - 1)):
            raise invalid(self, "radii_m", radii, "must increase from each to the next")
        if len(probabilities) != len(radii):
            rule = f"must have as many entries as radii_m ({len(radii)})"
            raise invalid(self, "probabilities", probabilities, rule)

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """Return one fault with the onsets of all sensors hit; none without sensors.

        The centre, the time and one number for each sensor are drawn in this order, wherever the
        sensors are: robots that share a generator receive the same blow.
        """
        choice, share = rng.random(), rng.random()
        luck = rng.random(channels.size)
        if not channels.size:
            return ()
        centre = channels.position[int(choice * channels.size)]
        hit = luck < self._probability(np.linalg.norm(channels.position - centre, axis=1))
        time = scale(share, self.earliest_s, self.latest_s)
        return (Fault(self.effect, np.where(hit, time, math.inf)),)

    def _probability(self, distance: Array) -> Array:
        """Return the probability (n,) of failure at each distance [m] from the centre."""
        ring = np.searchsorted(np.asarray(self.radii_m, dtype=np.float64), distance)
        return np.array([*self.probabilities, 0.0])[ring]
