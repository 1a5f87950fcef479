"""Local damage: a blow hits one sensor and, less and less surely, those around it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import PROBABILITY, check, instance_of, invalid, is_number
from evoros.failure.protocol import Fault
from evoros.failure.timing import check_window, time_at
from evoros.filter.protocol import Channels, Filter
from evoros.filter.silence import Silence


@dataclass(frozen=True)
class SpatialFailure:
    """A sensor chosen uniformly is the centre of damage; all that fail do so at one time.

    A sensor fails with the probability that belongs to the least radius around the centre that
    reaches it (straight distance in space), independently of the others; beyond the last radius
    none does. The defaults are the treatment ``spatial`` of the 2018 paper (Evo-ROS).
    """

    radii_m: Sequence[float] = (0.03, 0.06, 0.09)  # increasing
    probabilities: Sequence[float] = (1.0, 2 / 3, 1 / 3)  # one for each radius
    earliest_s: float = 40.0
    latest_s: float = 80.0
    effect: Filter = field(default_factory=Silence)  # what happens to the readings

    def __post_init__(self) -> None:
        check(
            self,
            effect=instance_of(Filter, "a filter"),
        )
        check_window(self)
        self._check_rings()

    def _check_rings(self) -> None:
        radii, chances = self.radii_m, self.probabilities
        if not _is_list(radii) or not all(is_number(r) and r >= 0 for r in radii) or not radii:
            raise invalid(self, "radii_m", radii, "must be a list of numbers of at least 0")
        if any(radii[k] >= radii[k + 1] for k in range(len(radii) - 1)):
            raise invalid(self, "radii_m", radii, "must increase from each to the next")
        if not _is_list(chances) or not all(PROBABILITY.holds(p) for p in chances):
            raise invalid(self, "probabilities", chances, "must be a list of numbers from 0 to 1")
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


def _is_list(value: object) -> bool:
    return isinstance(value, list | tuple)
