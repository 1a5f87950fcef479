"""Local damage: a blow hits one sensor and, less and less surely, those around it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, PROBABILITY, Rule, checked, invalid
from evoros.failure.protocol import Fault
from evoros.failure.timing import check_window, time_at
from evoros.filter.protocol import A_FILTER, Channels, Filter
from evoros.filter.silence import Silence

RADII = Rule(
    "a list of numbers of at least 0",
    lambda v: isinstance(v, list | tuple) and len(v) > 0 and all(map(NOT_NEGATIVE.holds, v)),
)
PROBABILITIES = Rule(
    "a list of numbers from 0 to 1",
    lambda v: isinstance(v, list | tuple) and all(map(PROBABILITY.holds, v)),
)


@dataclass(frozen=True)
@checked
class SpatialFailure:
    """A sensor chosen uniformly is the centre of damage; all that fail do so at one time.

    A sensor fails with the probability that belongs to the least radius around the centre that
    reaches it (straight distance in space), independently of the others; beyond the last radius
    none does. The defaults are the treatment ``spatial`` of the 2018 paper (Evo-ROS).
    """

    radii_m: Annotated[Sequence[float], RADII] = (0.03, 0.06, 0.09)  # increasing
    probabilities: Annotated[Sequence[float], PROBABILITIES] = (1.0, 2 / 3, 1 / 3)  # by radius
    earliest_s: Annotated[float, NOT_NEGATIVE] = 40.0
    latest_s: Annotated[float, NOT_NEGATIVE] = 80.0
    effect: Annotated[Filter, A_FILTER] = field(default_factory=Silence)  # acts on the readings

    def __post_init__(self) -> None:
        check_window(self)
        radii, chances = self.radii_m, self.probabilities
        if any(radii[k] >= radii[k + 1] for k in range(len(radii) - 1)):
            raise invalid(self, "radii_m", radii, "must increase from each to the next")
        if len(chances) != len(radii):
            rule = f"must have as many entries as radii_m ({len(radii)})"
            raise invalid(self, "probabilities", chances, rule)

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """One fault with the onsets of all sensors hit; none without sensors.

        Draws the centre, the time and then one number for each sensor, wherever the sensors are:
        robots that share a generator are dealt the same blow.
        """
        choice, moment = rng.random(), rng.random()
        luck = rng.random(channels.size)
        if not channels.size:
            return ()
        centre = channels.position[int(choice * channels.size)]
        hit = luck < self._chance(np.linalg.norm(channels.position - centre, axis=1))
        time = time_at(self, moment)
        return (Fault(self.effect, np.where(hit, time, math.inf)),)

    def _chance(self, distance: Array) -> Array:
        """(n,) probability of failure at each distance [m] from the centre."""
        ring = np.searchsorted(np.asarray(self.radii_m, dtype=np.float64), distance)
        return np.array([*self.probabilities, 0.0])[ring]
