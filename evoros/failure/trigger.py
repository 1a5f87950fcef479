"""The events of a mission from which the onset of a fault counts."""

import math
from dataclasses import dataclass
from typing import Self

START, PLACE, COURSE, DISTANCE, WAYPOINT, USE = TRIGGERS = range(6)
"""Kinds of events: the start of the mission; the robot comes to a place; it has made a share of its
course, or a length of it; it has reached so many waypoints; it has used up a supply."""


@dataclass(frozen=True)
class Trigger:
    """An event of a mission, by default its start; the first time counts."""

    kind: int = START
    values: tuple[float, ...] = ()  # as the constructors below list them
    since_s: float = 0.0  # the time of the mission from which it counts, if it came amid one

    @classmethod
    def at_place(cls, x_m: float, y_m: float, radius_m: float) -> Self:
        """The robot's origin comes within ``radius_m`` of a place."""
        return cls(PLACE, (x_m, y_m, radius_m))

    @classmethod
    def on_course(cls, share: float) -> Self:
        """The robot has made this share of its route, 0 to 1, by the lengths of its legs."""
        return cls(COURSE, (share,))

    @classmethod
    def after_distance(cls, distance_m: float) -> Self:
        """The robot has made so much of its route."""
        return cls(DISTANCE, (distance_m,))

    @classmethod
    def at_waypoint(cls, number: int) -> Self:
        """The robot reaches a waypoint of its route, which counts from 1 and includes home."""
        return cls(WAYPOINT, (float(number),))

    @classmethod
    def by_use(cls, amount: float, per_s: float, per_m: float) -> Self:
        """The robot has used ``amount``, by so much for each second and each metre driven."""
        return cls(USE, (amount, per_s, per_m))


AT_START = Trigger()


def is_timed(trigger: Trigger) -> bool:
    """Whether an onset counts from the start of the mission, so that it is a time."""
    return trigger.kind == START


NEVER = math.inf
"""The onset [s] of a fault that does not occur."""
