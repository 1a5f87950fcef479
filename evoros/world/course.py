"""The course: a robot's route through a world."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base import checks
from evoros.base.arrays import Array

PAIRS = checks.sequence_of((list, tuple), "waypoints [x, y]")
ONE_WAY = "one_way"
DIRECTION = checks.one_of("random", "forward", "backward", "parity", ONE_WAY)


@dataclass(frozen=True)
@checks.checked
class Course:
    """A route around the corners to home, then in reverse; if ``one_way``, to the last corner."""

    home_x_m: Annotated[float, checks.NUMBER]
    home_y_m: Annotated[float, checks.NUMBER]
    home_z_m: Annotated[float, checks.NOT_NEGATIVE]  # height of the robot's base frame at the start
    home_yaw_rad: Annotated[float, checks.NUMBER]
    waypoints: Annotated[Sequence[Sequence[float]], PAIRS]  # corners [m], without home
    acceptance_m: Annotated[float, checks.POSITIVE]  # radius [m] at which a waypoint is reached
    time_limit_s: Annotated[float, checks.POSITIVE]
    direction: Annotated[str, DIRECTION]  # first direction; ``parity``: forward in even rounds
    end_on_collision: Annotated[bool, checks.FLAG]

    def __post_init__(self) -> None:
        if not self.waypoints:
            rule = "must have at least one waypoint"
            raise checks.invalid(self, "waypoints", self.waypoints, rule)
        for point in self.waypoints:
            if len(point) != 2 or not all(map(checks.is_number, point)):
                raise checks.invalid(self, "waypoints", point, "each must be two numbers [x, y]")
        # Tuples make the course immutable, and equal courses compare equal.
        corners = tuple((float(x), float(y)) for x, y in self.waypoints)
        object.__setattr__(self, "waypoints", corners)

    @property
    def home(self) -> tuple[float, float, float, float]:
        """The robot's start: x, y, z [m] and yaw [rad]."""
        return (self.home_x_m, self.home_y_m, self.home_z_m, self.home_yaw_rad)

    @property
    def is_one_way(self) -> bool:
        """True if the mission is completed at the last corner."""
        return self.direction == ONE_WAY

    @property
    def first_phase(self) -> Array:
        """Points (n, 2) [m]: home, the corners and, unless one-way, home again."""
        end = [] if self.is_one_way else [self.home[:2]]
        return np.array([self.home[:2], *self.waypoints, *end], dtype=np.float64)

    def goes_forward(self, round_index: int, rng: Generator) -> bool:
        """Return True if a round visits the corners in the given order; may use ``rng``."""
        if self.direction == "random":
            return bool(rng.random() < 0.5)
        if self.direction == "parity":
            return round_index % 2 == 0
        return self.direction in ("forward", ONE_WAY)

    def route(self, forward: bool) -> Array:
        """Return the goals (n, 2) [m] of all legs; for a one-way route, only the corners."""
        if self.is_one_way:
            return np.array(self.waypoints, dtype=np.float64)
        corners = self.waypoints if forward else self.waypoints[::-1]
        home = self.home[:2]
        return np.array([*corners, home, *corners[::-1], home], dtype=np.float64)


A_COURSE = checks.instance_of(Course, "a course (evoros.world.course.Course)")
