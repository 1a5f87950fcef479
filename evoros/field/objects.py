"""Objects of two sizes on open ground: narrow targets behind waypoints, and wide decoys."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from numpy.random import Generator

from evoros.base import checks, elementary
from evoros.base.arrays import Array
from evoros.base.rng import generator
from evoros.compilation.elementary_arrays import atan2_all
from evoros.field.drawn import Distribution, draw_example
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.course import A_COURSE, Course
from evoros.world.floors import GROUND
from evoros.world.model import World

MAX_ATTEMPTS = 1000  # maximum number of random positions for a decoy
BEHIND_M = 0.1  # [m], distance from a waypoint to the surface of the target behind it


@dataclass(frozen=True)
@checks.checked
class Objects(Distribution):
    """A distribution of upright cylinders: narrow targets behind waypoints, and wide decoys.

    A target is behind its waypoint as seen from home. ``seed`` and the key of the random draws
    determine the bytes of the SDF. The distance of a decoy from home is uniform in ``distance_m``.
    Its bearing is uniform among those at least ``apart_deg`` from the other objects. No decoy
    covers a waypoint's acceptance area.
    """

    kind: ClassVar[str] = "group of objects"
    world_name: ClassVar[str] = "objects"
    course: Annotated[Course, A_COURSE]
    target_m: Annotated[float, checks.POSITIVE]  # diameter of the targets
    decoy_m: Annotated[float, checks.POSITIVE]  # diameter of the decoys
    decoys: Annotated[int, replace(checks.COUNT, limit=100)]
    distance_m: Annotated[checks.Interval, checks.INTERVAL]  # home to the nearest point of a decoy
    apart_deg: Annotated[float, checks.number_between(0.0, 180.0)]
    height_m: Annotated[float, checks.POSITIVE]
    seed: Annotated[int, checks.SEED] = 0

    def __post_init__(self) -> None:
        if checks.bounds(self.distance_m)[0] <= 0.0:
            raise checks.invalid(self, "distance_m", self.distance_m, "must be greater than 0")
        if self.course.home[:2] in self.course.waypoints:
            rule = "must have waypoints away from home (objects stand behind waypoints)"
            raise checks.invalid(self, "course", [*self.course.home[:2]], rule, "move the waypoint")

    def __hash__(self) -> int:
        """Hash the numbers, because an interval may be a list."""
        return hash((self.seed, self.decoys, self.course))

    def draw_bodies(self, draws: str) -> tuple[Body, ...]:
        """Return the ground, targets and decoys; raise an InputError if the decoys do not fit."""
        rng = generator(draws, f"objects {self.seed}")
        return (GROUND, *self._place_targets(), *self._draw_decoys(rng))

    def _place_targets(self) -> Iterator[Body]:
        home = np.array(self.course.home[:2])
        for index, point in enumerate(self.course.waypoints, 1):
            offset = np.array(point) - home
            length = math.hypot(*offset.tolist())
            place = home + offset * (1.0 + (BEHIND_M + self.target_m / 2) / length)
            x, y = np.round(place, 3).tolist()
            yield self._build(f"target_{index}", self.target_m, x, y)

    def _draw_decoys(self, rng: Generator) -> Iterator[Body]:
        home = np.array(self.course.home[:2])
        offsets = np.array(self.course.waypoints) - home
        taken = atan2_all(offsets[:, 1], offsets[:, 0])
        for index in range(1, self.decoys + 1):
            bearing, place = self._draw_place(taken, rng)
            taken = np.append(taken, bearing)
            x, y = np.round(place, 3).tolist()
            yield self._build(f"decoy_{index}", self.decoy_m, x, y)

    def _draw_place(self, taken: Array, rng: Generator) -> tuple[float, Array]:
        home, points = np.array(self.course.home[:2]), np.array(self.course.waypoints)
        for _ in range(MAX_ATTEMPTS):
            bearing = (2.0 * float(rng.random()) - 1.0) * math.pi
            turns = np.abs((bearing - taken + math.pi) % (2.0 * math.pi) - math.pi)
            if turns.min() < math.radians(self.apart_deg):
                continue
            near = checks.scale(float(rng.random()), *checks.bounds(self.distance_m))
            sin, cos = elementary.sin_cos(bearing)
            place: Array = home + (near + self.decoy_m / 2) * np.array((cos, sin))
            gaps = np.sqrt(((points - place) ** 2).sum(axis=1)) - self.decoy_m / 2
            if gaps.min() > self.course.acceptance_m:
                return bearing, place
        rule = f"must leave room for {self.decoys} decoys and all waypoints"
        raise checks.invalid(self, "apart_deg", self.apart_deg, rule, "lower apart_deg or decoys")

    def _build(self, name: str, diameter: float, x: float, y: float) -> Body:
        pose = Pose((x, y, self.height_m / 2))
        return Body(name, pose, (Shape("cylinder", (diameter / 2, self.height_m)),))


def generate_objects(
    course: Course,
    target_m: float,
    decoy_m: float,
    decoys: int,
    distance_m: Annotated[checks.Interval, checks.INTERVAL],
    apart_deg: float,
    height_m: float,
    seed: int = 0,
    renew: bool = False,
) -> World:
    """Generate objects, with ``renew`` new decoys for each mission; see ``Objects``."""
    objects = Objects(course, target_m, decoy_m, decoys, distance_m, apart_deg, height_m, seed)
    return draw_example(objects, renew, "generate_objects")
