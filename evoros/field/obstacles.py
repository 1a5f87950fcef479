"""The obstacles of a generated field, placed one after another, and the surrounding walls."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base import checks
from evoros.base.arrays import Array
from evoros.geometry.footprint import Footprint, bounding_circle, distances, project_shape
from evoros.geometry.free_space import FreeSpace, label_regions
from evoros.geometry.polygon import polygon_distance
from evoros.geometry.polyhedron import solid_moments
from evoros.geometry.shapes import MASS, Body, Pose, Shape

_MIN_SIZE_M = 0.001  # minimum size, and the resolution of sizes [m]
SIZE = checks.Rule(
    f"a number >= {_MIN_SIZE_M:g}, or [low, high] with such numbers and low <= high",
    lambda v: checks.INTERVAL.holds(v) and checks.bounds(v)[0] >= _MIN_SIZE_M,
)


class ObstacleKind(ABC):
    """A random distribution of obstacles, named in the SDF by its lower-case class name."""

    share: float = 1.0  # relative frequency of the kind
    mass_kg: float | None = None  # mass [kg] of an obstacle that can be pushed; None: fixed

    @abstractmethod
    def draw(self, rng: Generator) -> Shape:
        """Generate the shape of an obstacle: a box or cylinder with sizes in whole millimetres."""


KINDS = checks.mapping_of(ObstacleKind, "kinds of obstacles (subclasses of ObstacleKind)")


@dataclass(frozen=True)
@checks.checked
class Box(ObstacleKind):
    """An upright box, such as a crate, a kerb or a wall."""

    length_m: Annotated[checks.Interval, SIZE]
    width_m: Annotated[checks.Interval, SIZE]
    height_m: Annotated[checks.Interval, SIZE]
    share: Annotated[float, checks.POSITIVE] = 1.0
    mass_kg: Annotated[float | None, MASS] = None

    def draw(self, rng: Generator) -> Shape:
        """Generate a box with random length (x), width (y) and height (z)."""
        intervals = (self.length_m, self.width_m, self.height_m)
        return Shape("box", tuple(_draw_size(interval, rng) for interval in intervals))


@dataclass(frozen=True)
@checks.checked
class Cylinder(ObstacleKind):
    """An upright cylinder, such as a post, a trunk or a barrel."""

    diameter_m: Annotated[checks.Interval, SIZE]
    height_m: Annotated[checks.Interval, SIZE]
    share: Annotated[float, checks.POSITIVE] = 1.0
    mass_kg: Annotated[float | None, MASS] = None

    def draw(self, rng: Generator) -> Shape:
        """Generate a cylinder with random diameter and height."""
        diameter, height = (_draw_size(size, rng) for size in (self.diameter_m, self.height_m))
        return Shape("cylinder", (diameter / 2, height))


def _draw_size(interval: checks.Interval, rng: Generator) -> float:
    return round(checks.scale(float(rng.random()), *checks.bounds(interval)), 3)


CELL_M = 0.2
# A disc with this margin [m] at all cell centres of a path is free along the whole path.
MARGIN_M = 0.1415


class Passage:
    """Free paths for a disc of diameter ``width`` [m] on the legs of routes, among obstacles.

    ``low`` and ``high`` are the field's corners (2,) [m]. A radius of ``width / 2 + 2 * MARGIN_M``
    around each of the points (n, 2) [m] of ``routes`` must be free.
    """

    def __init__(self, low: Array, high: Array, routes: Sequence[Array], width: float) -> None:
        columns, rows = (math.ceil((b - a) / CELL_M) for a, b in zip(low, high, strict=True))
        self._space = FreeSpace(low, np.ones((rows, columns), dtype=np.bool_), CELL_M)
        self._radius = width / 2 + MARGIN_M
        cells = [((points - low) / CELL_M).astype(int)[:, ::-1].tolist() for points in routes]
        self._legs = [leg for places in cells for leg in pairwise(map(tuple, places))]

    def add(self, footprint: Footprint) -> bool:
        """Add an obstacle if every leg keeps a free path; return True if it was added."""
        free = self._space.free
        window, blocked = self._space.find_near(footprint, self._radius)
        before = free[window].copy()
        free[window] &= ~blocked
        regions = label_regions(free, diagonals=True)
        if all(0 < regions[start] == regions[goal] for start, goal in self._legs):
            return True
        free[window] = before
        return False


MAX_POSES = 300  # maximum number of random poses for an obstacle


@dataclass
class PlacedObstacles:
    """The obstacles placed so far, and the area where others may be placed.

    ``low`` and ``high`` are opposite corners (2,) [m] of the field, whose margin of ``inset`` [m]
    stays free. Obstacles keep a distance of ``clearing`` [m] from the route's ``points`` (n, 2) [m]
    and of ``gap`` [m] from each other, and do not block ``passage``.
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
        """Place a shape upright at a random pose, and return the pose; None if no room is found."""
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
        """Add an obstacle if there is room; return True if it was added."""
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
        x, y, radius = bounding_circle(footprint)
        apart = np.sqrt(((self._centres - (x, y)) ** 2).sum(axis=1)) - self._radii - radius
        near = (self.footprints[i] for i in np.flatnonzero(apart < self.gap))
        return any(_distance(footprint, other, self.gap) <= self.gap for other in near)


def _distance(first: Footprint, second: Footprint, cutoff: float) -> float:
    """Return the distance [m] between footprints, or a lower bound if it exceeds ``cutoff``."""
    radii = first.radius + second.radius
    for area, point in ((first, second), (second, first)):
        if len(point.vertices) == 1:
            return float(distances(area, point.vertices)[0]) - point.radius
    return polygon_distance(first.vertices, second.vertices, cutoff + radii) - radii


WALL_WIDTH_M, WALL_HEIGHT_M = 0.2, 1.0


def draw_obstacles(
    kinds: Mapping[str, ObstacleKind], count: int, placed: PlacedObstacles, rng: Generator
) -> Iterator[Body]:
    """Place ``count`` random obstacles and yield them; stop early when an obstacle does not fit."""
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
    """Return four walls around the field with these opposite corners (2,) [m]."""
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
