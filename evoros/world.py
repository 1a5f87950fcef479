"""Worlds: what stands where, and the route that a robot has to drive through it."""

import hashlib
import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.random import Generator

from evoros.assets import find
from evoros.body import Body, Pose, Shape
from evoros.errors import (
    FLAG,
    NOT_NEGATIVE,
    NUMBER,
    POSITIVE,
    TEXT,
    InputError,
    check,
    instance_of,
    invalid,
    is_number,
    one_of,
    sequence_of,
)
from evoros.geometry import contains, footprint, highest, lowest
from evoros.sdf.reader import read_sdf
from evoros.sdf.writer import write_sdf
from evoros.types import Array

__all__ = ["Body", "Course", "Pose", "Shape", "World", "load_world"]

LOW_M = 0.3
"""An obstacle whose underside is higher than this above the ground may stand over a waypoint."""


@dataclass(frozen=True)
class Course:
    """A route in two phases: the corners and home again, then the same backwards and home."""

    home_x_m: float
    home_y_m: float
    home_z_m: float  # height of the robot's base frame when it is set down
    home_yaw_rad: float
    waypoints: Sequence[Sequence[float]]  # the corners [[x, y], ...] [m]; home is appended
    acceptance_m: float  # a waypoint counts within this distance
    time_limit_s: float
    direction: str  # of the first phase: random, forward, backward, parity (of the generation)
    end_on_collision: bool

    def __post_init__(self) -> None:
        check(
            self,
            home_x_m=NUMBER,
            home_y_m=NUMBER,
            home_z_m=NOT_NEGATIVE,
            home_yaw_rad=NUMBER,
            acceptance_m=POSITIVE,
            time_limit_s=POSITIVE,
            direction=one_of("random", "forward", "backward", "parity"),
            end_on_collision=FLAG,
            waypoints=sequence_of((list, tuple), "waypoints [x, y]"),
        )
        if not self.waypoints:
            raise invalid(self, "waypoints", self.waypoints, "must have at least one waypoint")
        for point in self.waypoints:
            if len(point) != 2 or not all(map(is_number, point)):
                raise invalid(self, "waypoints", point, "each must be two numbers [x, y]")
        # Tuples, so that a frozen course cannot change and equal courses compare equal.
        corners = tuple((float(x), float(y)) for x, y in self.waypoints)
        object.__setattr__(self, "waypoints", corners)

    @property
    def home(self) -> tuple[float, float, float, float]:
        """x, y, z [m] and yaw [rad] where the robot starts."""
        return (self.home_x_m, self.home_y_m, self.home_z_m, self.home_yaw_rad)

    def goes_forward(self, generation: int, rng: Generator) -> bool:
        """Whether the first phase takes the corners in their order; draws only if random."""
        if self.direction == "random":
            return bool(rng.random() < 0.5)
        if self.direction == "parity":
            return generation % 2 == 0
        return self.direction == "forward"

    def route(self, forward: bool) -> Array:
        """The goals of all legs in order, (2 * (corners + 1), 2) [m]."""
        home = (self.home_x_m, self.home_y_m)
        there = self.waypoints if forward else self.waypoints[::-1]
        return np.array([*there, home, *there[::-1], home], dtype=np.float64)


@runtime_checkable
class Renewal(Protocol):
    """Draws worlds."""

    def world(self, draws: str) -> "World":
        """The world under this key of random draws, always with the same course."""
        ...


@dataclass(frozen=True)
class World:
    """Bodies and a course among them. Every world has level ground at z = 0.

    A world that is renewed is another one under each mission's draws, and itself an example.
    """

    name: str
    bodies: tuple[Body, ...]
    course: Course
    source: str  # the file, as the configuration names it
    source_sha256: str  # of its content
    renewal: Renewal | None = None  # None: always the same
    note: str = ""  # what its SDF says of it: where it comes from

    def __post_init__(self) -> None:
        check(
            self,
            name=TEXT,
            bodies=sequence_of(Body, "bodies"),
            course=instance_of(Course, "a course (evoros.world.Course)"),
            source=TEXT,
            renewal=instance_of(Renewal | None, "what draws worlds (world)"),
        )
        _check_names(self)
        _check_ground(self)
        _check_course(self)

    def __hash__(self) -> int:
        # Not of all bodies: what is computed from a world is kept by it.
        return hash((self.name, self.source_sha256))

    def at(self, draws: str) -> "World":
        """The world that a mission under this key of random draws meets."""
        return self if self.renewal is None else self.renewal.world(draws)

    @property
    def sdf(self) -> str:
        """The bodies as an SDF file."""
        return write_sdf(self.name, self.bodies, self.note)

    @property
    def obstacles(self) -> tuple[Body, ...]:
        """All bodies but the ground."""
        return tuple(body for body in self.bodies if not body.is_ground)


def load_world(sdf: str, course: Course) -> World:
    """The world of an SDF file; a level ground is added if the file has none.

    ``sdf`` is a path, or relative to the bundled ``worlds``. The world's name, in messages, is the
    file's; tables name it by its key in the configuration.

    Raises:
        InputError: no such file, an element that cannot be used, a waypoint in an obstacle.
    """
    path = find(sdf, "worlds")
    content = path.read_bytes()
    bodies = read_sdf(content, sdf)
    if not any(body.is_ground for body in bodies):
        logging.getLogger(__name__).warning("%s: no plane: level ground is added", sdf)
        bodies = (Body("ground", Pose(), (Shape("plane", (0.0, 0.0, 1.0)),)), *bodies)
    return World(Path(sdf).stem, bodies, course, sdf, hashlib.sha256(content).hexdigest())


def _check_names(world: World) -> None:
    seen: set[str] = set()
    for body in world.bodies:
        if body.name in seen:
            raise invalid(world, "bodies", body.name, "names must differ", "rename one of the two")
        seen.add(body.name)


def _check_ground(world: World) -> None:
    heights = []
    for body in world.bodies:
        for shape in body.shapes if body.is_ground else ():
            pose = body.pose @ shape.pose
            normal = pose.rotation @ np.array(shape.size) / np.linalg.norm(shape.size)
            if math.hypot(normal[0], normal[1]) > 1e-6 or normal[2] < 0:
                raise InputError(
                    f"{world.source}: the ground plane {body.name!r} must be level and face up, "
                    f"not {np.round(normal, 6).tolist()}; use a box for anything else"
                )
            heights.append(pose.position[2])
    if not heights or abs(max(heights)) > 1e-6:
        found = f"its highest is at {max(heights):g}" if heights else "it has none"
        raise InputError(
            f"{world.source}: a world must have ground at z = 0 m; {found}: put it there"
        )


def _check_course(world: World) -> None:
    course = world.course
    places = {f"waypoint {i} {point}": point for i, point in enumerate(course.waypoints)}
    places[f"home ({course.home_x_m}, {course.home_y_m})"] = (course.home_x_m, course.home_y_m)
    for body in world.obstacles:
        for shape in body.shapes:
            pose = body.pose @ shape.pose
            if lowest(shape, pose) > LOW_M or highest(shape, pose) <= 0.0:
                continue
            outline = footprint(shape, pose)
            for place, (x, y) in places.items():
                if contains(outline, (x, y)):
                    raise InputError(
                        f"{world.source}: {place} of the course lies inside the obstacle "
                        f"{body.name!r}; move one of the two"
                    )
