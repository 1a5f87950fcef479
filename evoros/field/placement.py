"""Puts obstacles into a field one after another, each where the others and the route leave room."""

from dataclasses import dataclass

import numpy as np

from evoros.base.arrays import Array
from evoros.field.passage import Passage
from evoros.geometry.footprint import Footprint, distances
from evoros.geometry.polygon import gap


@dataclass
class PlacedObstacles:
    """The obstacles so far, and what the next one must leave free.

    ``low`` and ``high`` are opposite corners (2,) of the ground for obstacles [m]; ``places``
    (n, 2) are the points [m] of the route, from which they stay ``clearing`` [m] away, as they stay
    ``gap`` [m] from each other. The way of ``passage`` stays open.
    """

    low: Array
    high: Array
    places: Array
    clearing: float
    gap: float
    passage: Passage

    def __post_init__(self) -> None:
        self.areas: list[Footprint] = []
        self._centres, self._reaches = np.empty((0, 2)), np.empty(0)

    def takes(self, area: Footprint) -> bool:
        """Whether an obstacle of this footprint has room; it is then there."""
        corners = area.vertices
        inside = (corners - area.radius >= self.low) & (corners + area.radius <= self.high)
        if not inside.all() or distances(area, self.places).min() < self.clearing:
            return False
        if self._crowds(area) or not self.passage.admits(area):
            return False
        self._keep(area)
        return True

    def _keep(self, area: Footprint) -> None:
        self.areas.append(area)
        centre, reach = _disc(area)
        self._centres = np.vstack((self._centres, centre))
        self._reaches = np.append(self._reaches, reach)

    def _crowds(self, area: Footprint) -> bool:
        """Whether it would be nearer than the gap to another one; only near ones are measured."""
        centre, reach = _disc(area)
        apart = np.sqrt(((self._centres - centre) ** 2).sum(axis=1)) - self._reaches - reach
        near = (self.areas[i] for i in np.flatnonzero(apart < self.gap))
        return any(_between(area, other, self.gap) <= self.gap for other in near)


def _disc(area: Footprint) -> tuple[Array, float]:
    """Centre and radius of a disc around a footprint."""
    centre = area.vertices.mean(axis=0)
    reach = np.sqrt(((area.vertices - centre) ** 2).sum(axis=1)).max()
    return centre, float(reach) + area.radius


def _between(one: Footprint, other: Footprint, enough: float) -> float:
    """Distance [m] of two footprints, or a lower bound of more than ``enough``."""
    radii = one.radius + other.radius
    for area, point in ((one, other), (other, one)):
        if len(point.vertices) == 1:
            return float(distances(area, point.vertices)[0]) - point.radius
    return gap(one.vertices, other.vertices, enough + radii) - radii
