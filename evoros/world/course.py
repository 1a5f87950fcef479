"""The route through a world."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import (
    FLAG,
    NOT_NEGATIVE,
    NUMBER,
    POSITIVE,
    checked,
    instance_of,
    invalid,
    is_number,
    one_of,
    sequence_of,
)

PAIRS = sequence_of((list, tuple), "waypoints [x, y]")
DIRECTION = one_of("random", "forward", "backward", "parity")


@dataclass(frozen=True)
@checked
class Course:
    """A route in two phases: the corners and home again, then the same backwards and home.

    A course that is ``one_way`` ends at its last corner.
    """

    home_x_m: Annotated[float, NUMBER]
    home_y_m: Annotated[float, NUMBER]
    home_z_m: Annotated[float, NOT_NEGATIVE]  # height of the robot's base frame when it is set down
    home_yaw_rad: Annotated[float, NUMBER]
    waypoints: Annotated[Sequence[Sequence[float]], PAIRS]  # the corners [m]; home is appended
    acceptance_m: Annotated[float, POSITIVE]  # a waypoint counts within this distance
    time_limit_s: Annotated[float, POSITIVE]
    direction: Annotated[str, DIRECTION]  # of the first phase; parity: forward in even rounds
    end_on_collision: Annotated[bool, FLAG]
    one_way: Annotated[bool, FLAG] = False

    def __post_init__(self) -> None:
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
        """The start of the robot: x, y, z [m] and yaw [rad]."""
        return (self.home_x_m, self.home_y_m, self.home_z_m, self.home_yaw_rad)

    def goes_forward(self, round_index: int, rng: Generator) -> bool:
        """Return whether the first phase of a round visits the corners in their order.

        Only a random direction draws a number from ``rng``.
        """
        if self.direction == "random":
            return bool(rng.random() < 0.5)
        if self.direction == "parity":
            return round_index % 2 == 0
        return self.direction == "forward"

    def route(self, forward: bool) -> Array:
        """Return the goals of all legs in order, (2 * (corners + 1), 2) or (corners, 2) [m]."""
        home = (self.home_x_m, self.home_y_m)
        corners = self.waypoints if forward else self.waypoints[::-1]
        if self.one_way:
            return np.array(corners, dtype=np.float64)
        return np.array([*corners, home, *corners[::-1], home], dtype=np.float64)


A_COURSE = instance_of(Course, "a course (evoros.world.course.Course)")
