"""The bodies of a generated field: obstacles, placed one after another, and a wall around them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.field.kinds import ObstacleKind
from evoros.field.passage import Passage
from evoros.geometry.footprint import Footprint, bounding_circle, distances, project_shape
from evoros.geometry.inertia import solid_moments
from evoros.geometry.polygon import polygon_distance
from evoros.geometry.shapes import Body, Pose, Shape

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


WALL_WIDTH_M, WALL_HEIGHT_M = 0.2, 1.0


def draw_obstacles(
    kinds: Mapping[str, ObstacleKind], count: int, placed: PlacedObstacles, rng: Generator
) -> Iterator[Body]:
    """Yield ``count`` obstacles among those already placed; fewer if one finds no room."""
    names = list(kinds)
    shares = np.cumsum([kind.share for kind in kinds.values()])
    for rank in range(1, count + 1):
        index = int(np.searchsorted(shares, rng.random() * shares[-1], side="right"))
        kind = kinds[names[index]]
        shape = kind.draw(rng)
        pose = placed.place(shape, rng)
        if pose is None:
            return
        inertia = None if kind.mass_kg is None else solid_moments(shape, kind.mass_kg)
        yield Body(f"{names[index]}_{rank}", pose, (shape,), kind.mass_kg, inertia=inertia)


def build_walls(low: Array, high: Array) -> tuple[Body, ...]:
    """Build four walls around a field with these opposite corners (2,) [m]."""
    (x, y), (length, width) = (low + high) / 2, high - low
    offset = WALL_WIDTH_M / 2
    along_x = Shape("box", (length + 2 * WALL_WIDTH_M, WALL_WIDTH_M, WALL_HEIGHT_M))
    along_y = Shape("box", (WALL_WIDTH_M, width, WALL_HEIGHT_M))
    walls = (
        ("south", (x, low[1] - offset), along_x),
        ("north", (x, high[1] + offset), along_x),
        ("west", (low[0] - offset, y), along_y),
        ("east", (high[0] + offset, y), along_y),
    )
    return tuple(
        Body(f"wall_{side}", Pose((*middle, WALL_HEIGHT_M / 2)), (box,))
        for side, middle, box in walls
    )
