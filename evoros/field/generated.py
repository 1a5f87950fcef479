"""Random fields of obstacles around a course, with a free path along the course."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from evoros.base import checks
from evoros.base.arrays import Array
from evoros.base.rng import generator
from evoros.field.drawn import Distribution, draw_example
from evoros.field.obstacles import (
    KINDS,
    MARGIN_M,
    ObstacleKind,
    Passage,
    PlacedObstacles,
    build_walls,
    draw_obstacles,
)
from evoros.geometry.footprint import project_bodies
from evoros.geometry.shapes import Body
from evoros.world.course import A_COURSE, Course
from evoros.world.floors import GROUND
from evoros.world.model import World

MAX_ATTEMPTS = 50  # maximum number of restarts because an obstacle does not fit
MIN_SHARE = 0.5  # minimum share of placed obstacles for another attempt
EXTENT = checks.Rule(
    "two numbers [x, y] greater than 0",
    lambda v: isinstance(v, list | tuple) and len(v) == 2 and all(map(checks.POSITIVE.holds, v)),
    limit=10_000.0,
)
MAX_COUNT = 100_000  # maximum number of obstacles in a field; more take hours to place


@dataclass(frozen=True)
@checks.checked
class Field(Distribution):
    """A distribution of fields of random obstacles around a course.

    ``seed`` and the key of the random draws determine the bytes of the SDF. Random poses, rounded
    to 1 mm and 1 mrad, are rejected near the route, near another obstacle or on the free path.
    """

    kind: ClassVar[str] = "field"
    world_name: ClassVar[str] = "generated"
    course: Annotated[Course, A_COURSE]
    extent_m: Annotated[Sequence[float], EXTENT]  # size along x and y, centred on the course
    density: Annotated[float, checks.NOT_NEGATIVE]  # obstacles per square metre
    kinds: Annotated[Mapping[str, ObstacleKind], KINDS]
    clearing_m: Annotated[float, checks.POSITIVE]  # radius of free area around home and waypoints
    gap_m: Annotated[float, checks.NOT_NEGATIVE]  # minimum distance between obstacles
    passage_m: Annotated[float, checks.POSITIVE]  # width of the free path on each leg
    enclosed: Annotated[bool, checks.FLAG]  # True: a wall surrounds the field
    seed: Annotated[int, checks.SEED] = 0
    # courses of other robots, also kept free
    others: Annotated[Sequence[Course], checks.sequence_of(Course, "courses")] = ()

    def __post_init__(self) -> None:
        if not self.kinds or not all(map(checks.NAME.holds, self.kinds)):
            rule = f"must have at least one kind, and each key must be {checks.NAME.text}"
            raise checks.invalid(self, "kinds", dict(self.kinds), rule)
        minimum = self.passage_m / 2 + 2 * MARGIN_M
        if self.clearing_m < minimum:
            rule = f"must be at least {minimum:.3f}, half of passage_m plus a margin"
            raise checks.invalid(self, "clearing_m", self.clearing_m, rule)
        low, high = self.corners
        if self.density * float((high - low).prod()) > MAX_COUNT:
            rule = f"must give at most {MAX_COUNT} obstacles on the area extent_m"
            raise checks.invalid(self, "density", self.density, rule)
        points = np.concatenate(self._routes)
        if (np.minimum(points - low, high - points) < self.clearing_m).any():
            robots = " of all robots" if self.others else ""
            rule = f"must reach at least clearing_m beyond home and all waypoints{robots}"
            raise checks.invalid(self, "extent_m", self.extent_m, rule, "increase extent_m")

    def __hash__(self) -> int:
        """Hash the numbers, because the mapping of kinds is not hashable."""
        return hash((self.seed, self.density, self.course))

    @property
    def _routes(self) -> list[Array]:
        """The points (n, 2) [m] of each robot's route, from home."""
        return [course.first_phase for course in (self.course, *self.others)]

    @property
    def corners(self) -> tuple[Array, Array]:
        """The corners [x, y] [m] of the field with the minimum and the maximum coordinates."""
        points = self._routes[0]
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        return middle - np.array(self.extent_m) / 2, middle + np.array(self.extent_m) / 2

    def keep_free(self, courses: Sequence[Course]) -> "Field":
        """Return the same field with free routes for other robots, too."""
        return replace(self, others=tuple(courses))

    def draw_bodies(self, draws: str) -> tuple[Body, ...]:
        """Return the ground, any walls, and random obstacles; InputError if they do not fit."""
        rng = generator(draws, f"field {self.seed}")
        low, high = self.corners
        walls = build_walls(low, high) if self.enclosed else ()
        count = round(self.density * float((high - low).prod()))
        max_placed = 0
        for _ in range(MAX_ATTEMPTS):
            obstacles = list(draw_obstacles(self.kinds, count, self._surround(walls), rng))
            if len(obstacles) == count:
                return (GROUND, *walls, *obstacles)
            max_placed = max(max_placed, len(obstacles))
            if len(obstacles) < MIN_SHARE * count:
                break
        rule = f"must leave room for all obstacles (only {max_placed} of {count} fit)"
        fix = "lower density, gap_m, clearing_m or the obstacles' sizes"
        raise checks.invalid(self, "density", self.density, rule, fix)

    def _surround(self, walls: Sequence[Body]) -> PlacedObstacles:
        passage = Passage(*self.corners, self._routes, self.passage_m)
        for footprint in project_bodies(walls):
            passage.add(footprint)
        inset, points = self.gap_m if walls else 0.0, np.concatenate(self._routes)
        return PlacedObstacles(*self.corners, inset, points, self.clearing_m, self.gap_m, passage)


def generate_world(
    course: Course,
    extent_m: Annotated[Sequence[float], EXTENT],
    density: float,
    kinds: Mapping[str, ObstacleKind],
    clearing_m: float,
    gap_m: float,
    passage_m: float,
    enclosed: bool,
    seed: int = 0,
    renew: bool = False,
) -> World:
    """Generate a world, with ``renew`` a new one for each mission; see ``Field``."""
    field = Field(course, extent_m, density, kinds, clearing_m, gap_m, passage_m, enclosed, seed)
    return draw_example(field, renew, "generate_world")
