"""A world: bodies on the ground, and a course among them."""

from collections import Counter
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from itertools import compress
from typing import Annotated, Protocol, Self, runtime_checkable

import numpy as np

from evoros.base.checks import POSITIVE, TEXT, Rule, checked, instance_of, invalid, sequence_of
from evoros.base.errors import InputError
from evoros.formats.sdf.actors import Actor
from evoros.formats.sdf.writer import write_sdf, write_surfaces
from evoros.geometry.footprint import distances, find_bounds, project_bodies
from evoros.geometry.shapes import Body
from evoros.walkers.crowd import Crowd
from evoros.world.course import A_COURSE, Course
from evoros.world.floors import MAT_M, check_planes, ground_height, has_level_ground

LENGTH = Rule("a positive length, or null", lambda v: v is None or POSITIVE.holds(v))
KEPT_WORLDS = 512  # cached worlds, such as the 300 of BARN, with outlines of 0.15 MB each
LOW_M = 0.3  # minimum ground clearance [m] of an obstacle below which waypoints are allowed


@runtime_checkable
class WorldSampler(Protocol):
    """A distribution of worlds with a common course."""

    def draw_world(self, draws: str) -> "World":
        """Draw the world of a mission; the key ``draws`` determines all random numbers."""


@runtime_checkable
class TeamSampler(WorldSampler, Protocol):
    """A sampler of worlds that can leave space for several robots with separate courses."""

    def keep_free(self, courses: Sequence[Course]) -> Self:
        """Return a sampler that keeps these courses free, as well as the first robot's course."""


A_SAMPLER = instance_of(WorldSampler, "a world sampler (an object with draw_world)")


@dataclass(frozen=True)
@checked
class World:
    """Bodies and a course, with ground at z = 0 at home; an example if there is a sampler."""

    name: Annotated[str, TEXT]
    bodies: Annotated[tuple[Body, ...], sequence_of(Body, "bodies")]
    course: Annotated[Course, A_COURSE]
    source: Annotated[str, TEXT]  # file, as named in the configuration
    source_sha256: str  # digest of the file's content
    sampler: Annotated[WorldSampler | None, A_SAMPLER] = None  # None: same world in all missions
    note: str = ""  # comment in the SDF on the origin of the world
    gravity_mps2: Annotated[float, POSITIVE] = 9.81  # downwards
    actors: Annotated[tuple[Actor, ...], sequence_of(Actor, "actors")] = ()  # actors in the file
    shortest_m: Annotated[float | None, LENGTH] = None  # length of the shortest path; None: unknown
    crowd: Crowd | None = field(default=None, compare=False)  # walkers of a mission

    def __post_init__(self) -> None:
        for name, count in Counter(body.name for body in self.bodies).most_common(1):
            if count > 1:
                raise invalid(self, "bodies", name, "names must differ", "rename one of the two")
        check_planes(self.bodies, self.source)
        height = ground_height(self.bodies, self.course.home[:2])
        if height is None or not -1e-6 <= height <= MAT_M + 1e-6:
            actual = "there is none" if height is None else f"it is at {height:g} m"
            problem = f"must have ground at z = 0 m at home, but {actual}"
            raise InputError(f"{self.source}: {problem}; put a floor there")
        _check_course(self)

    def __hash__(self) -> int:
        # Worlds are keys of caches, so hashing must be fast and omits the bodies.
        return hash((self.name, self.source_sha256))

    def at(self, draws: str) -> "World":
        """Return the world that a mission's key ``draws`` determines, with this world's course."""
        if self.sampler is None:
            return self
        drawn = self.sampler.draw_world(draws)
        return drawn if drawn.course == self.course else replace(drawn, course=self.course)

    def with_crowd(self, crowd: Crowd | None) -> "World":
        """Return this world with the walkers of a mission."""
        world = copy(self)
        object.__setattr__(world, "crowd", crowd)
        return world

    @property
    def sdf(self) -> str:
        """The bodies as SDF text, which refers to further ``files``."""
        return write_sdf(self.name, self.bodies, self.note, self.gravity_mps2)

    def files(self, stem: str) -> dict[str, bytes]:
        """Return the SDF file, called ``stem``, and the files it refers to, by file name."""
        sdf = write_sdf(self.name, self.bodies, self.note, self.gravity_mps2, stem)
        return {f"{stem}.sdf": sdf.encode(), **write_surfaces(stem, self.bodies)}

    @property
    def obstacles(self) -> tuple[Body, ...]:
        """All bodies except the ground."""
        return tuple(body for body in self.bodies if not body.is_ground)

    @property
    def is_level(self) -> bool:
        """True if the ground contains no tilted plane or height field."""
        return has_level_ground(self.bodies)


def _check_course(world: World) -> None:
    points = {f"waypoint {i}": point for i, point in enumerate(world.course.waypoints)}
    points["home"] = world.course.home[:2]
    places = np.array(list(points.values()), dtype=np.float64)
    for body in world.obstacles:
        for footprint in project_bodies([body], LOW_M, places):
            inside = distances(footprint, places) == 0.0
            for name, (x, y) in compress(points.items(), inside):
                keys = "home_x_m and home_y_m" if name == "home" else "waypoints"
                low, high = find_bounds(footprint)
                raise InputError(
                    f"{world.source}: {name} of the course, ({x:g}, {y:g}) m, must not lie "
                    f"inside the obstacle {body.name!r}, which covers x {low[0]:.2f}.."
                    f"{high[0]:.2f} and y {low[1]:.2f}..{high[1]:.2f} m; set {keys} to a "
                    f"free place, or let evoros inspect world suggest a course"
                )
