"""Local damage: an impact affects one sensor and, with decreasing probability, its neighbours."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base import checks
from evoros.failure.protocol import Failure, Fault
from evoros.filter.protocol import A_FILTER, Channels, Filter
from evoros.filter.silence import Silence

PROBABILITIES = checks.Rule(
    "a list of numbers from 0 to 1",
    lambda v: isinstance(v, list | tuple) and all(map(checks.PROBABILITY.holds, v)),
)


@dataclass(frozen=True)
@checks.checked
class SpatialFailure(Failure):
    """Damage around a random sensor; all failing sensors fail at the same time.

    Each sensor fails independently, with the probability for the smallest radius that is at least
    its distance from the chosen sensor (Euclidean). No sensor beyond the last radius fails. The
    defaults match the treatment ``spatial`` of the 2018 paper (Evo-ROS).
    """

    radii_m: Annotated[Sequence[float], checks.NOT_NEGATIVES] = (0.03, 0.06, 0.09)  # increasing
    probabilities: Annotated[Sequence[float], PROBABILITIES] = (1.0, 2 / 3, 1 / 3)  # one per radius
    earliest_s: Annotated[float, checks.NOT_NEGATIVE] = 40.0
    latest_s: Annotated[float, checks.NOT_NEGATIVE] = 80.0
    effect: Annotated[Filter, A_FILTER] = field(default_factory=Silence)  # applied to the readings

    def __post_init__(self) -> None:
        checks.check_order(self, "earliest_s", "latest_s")
        radii, probabilities = self.radii_m, self.probabilities
        if any(radii[k] >= radii[k + 1] for k in range(len(radii) - 1)):
            raise checks.invalid(self, "radii_m", radii, "must be in increasing order")
        if len(probabilities) != len(radii):
            rule = f"must have as many entries as radii_m ({len(radii)})"
            raise checks.invalid(self, "probabilities", probabilities, rule)

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """Draw the damage; with equal generators, all robots receive the same impact."""
        choice, share = rng.random(), rng.random()
        luck = rng.random(channels.size)
        if not channels.size:
            return ()
        centre = channels.position[int(choice * channels.size)]
        distance = np.linalg.norm(channels.position - centre, axis=1)
        ring = np.searchsorted(np.asarray(self.radii_m, dtype=np.float64), distance)
        hit = luck < np.array([*self.probabilities, 0.0])[ring]
        time = checks.scale(share, self.earliest_s, self.latest_s)
        return (Fault(self.effect, np.where(hit, time, math.inf)),)
