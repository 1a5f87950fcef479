"""Places obstacles one after another where the others and the route leave room."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.field.passage import Passage
from evoros.geometry.footprint import Footprint, bounding_circle, distances, project_shape
from evoros.geometry.polygon import polygon_distance
from evoros.geometry.shapes import Pose, Shape

MAX_POSES = 300
"""The number of poses that are tried for one obstacle."""


@dataclass
class PlacedObstacles:
    """The obstacles so far, and the room that the next one must leave.

    ``low`` and ``high`` are opposite corners (2,) [m] of the field, whose outermost ``inset`` [m]
    stays free; the route has ``points`` (n, 2) [m]. Obstacles stay ``clearing`` [m] away
    from these points and ``gap`` [m] from each other, and leave the way of ``passage`` open.
    """

    low: Array
    high: Array
    inset: float
    points: Array
    clearing: float
    gap: float
    passage: Passage

    def __post_init__(self) -> None:
        self.footprints: list[Footprint] = []
        self._centres, self._radii = np.empty((0, 2)), np.empty(0)

    def place(self, shape: Shape, rng: Generator) -> Pose | None:
        """Place a shape upright at a random position and heading; return None without room."""
        height = shape.size[-1] / 2
        for _ in range(MAX_POSES):
            u, v, w = rng.random(3).tolist()
            x, y = (
                round(float(a) + share * float(b - a), 3)
                for a, b, share in zip(self.low, self.high, (u, v), strict=True)
            )
            yaw = round((2 * w - 1) * np.pi, 3)
            pose = Pose.from_rpy((x, y, height), 0.0, 0.0, yaw)
            if self.add(project_shape(shape, pose)):
                return pose
        return None

    def add(self, footprint: Footprint) -> bool:
        """Add an obstacle if there is room for it, and return whether there is."""
        corners, radius = footprint.vertices, footprint.radius
        low, high = self.low + self.inset, self.high - self.inset
        inside = (corners - radius >= low) & (corners + radius <= high)
        if not inside.all() or distances(footprint, self.points).min() < self.clearing:
            return False
        if self._is_near_another(footprint) or not self.passage.add(footprint):
            return False
        self.footprints.append(footprint)
        x, y, radius = bounding_circle(footprint)
        self._centres = np.vstack((self._centres, (x, y)))
        self._radii = np.append(self._radii, radius)
        return True

    def _is_near_another(self, footprint: Footprint) -> bool:
        """Return whether another obstacle is within the gap; circles exclude the distant ones."""
        x, y, radius = bounding_circle(footprint)
        apart = np.sqrt(((self._centres - (x, y)) ** 2).sum(axis=1)) - self._radii - radius
        near = (self.footprints[i] for i in np.flatnonzero(apart < self.gap))
        return any(_distance(footprint, other, self.gap) <= self.gap for other in near)


def _distance(first: Footprint, second: Footprint, cutoff: float) -> float:
    """Return the distance [m] of two footprints, or a lower bound above ``cutoff``."""
    radii = first.radius + second.radius
    for area, point in ((first, second), (second, first)):
        if len(point.vertices) == 1:
            return float(distances(area, point.vertices)[0]) - point.radius
    return polygon_distance(first.vertices, second.vertices, cutoff + radii) - radii
