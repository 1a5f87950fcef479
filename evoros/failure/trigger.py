"""Mission events that trigger faults."""

import math
from dataclasses import dataclass
from typing import Self

START, PLACE, COURSE, DISTANCE, WAYPOINT, USE = TRIGGERS = range(6)
"""Kinds of events: the mission starts; the robot reaches a place, covers a share or a length of its
course, reaches a waypoint, or uses up a supply."""


@dataclass(frozen=True)
class Trigger:
    """An event of a mission, by default its start; only its first occurrence counts."""

    kind: int = START
    values: tuple[float, ...] = ()  # arguments of the constructors below
    since_s: float = 0.0  # mission time at which it was added

    @classmethod
    def at_place(cls, x_m: float, y_m: float, radius_m: float) -> Self:
        """The robot's origin comes within ``radius_m`` of a place."""
        return cls(PLACE, (x_m, y_m, radius_m))

    @classmethod
    def on_course(cls, share: float) -> Self:
        """The robot has covered this share of its route's length, 0 to 1."""
        return cls(COURSE, (share,))

    @classmethod
    def after_distance(cls, distance_m: float) -> Self:
        """The robot has covered this length of its route."""
        return cls(DISTANCE, (distance_m,))

    @classmethod
    def at_waypoint(cls, number: int) -> Self:
        """The robot reaches a waypoint, numbered from 1; home is the last."""
        return cls(WAYPOINT, (float(number),))

    @classmethod
    def by_use(cls, amount: float, per_s: float, per_m: float) -> Self:
        """The robot has used ``amount``, at these rates per second and per metre driven."""
        return cls(USE, (amount, per_s, per_m))


AT_START = Trigger()


def is_timed(trigger: Trigger) -> bool:
    """Return True if onsets after the trigger are mission times."""
    return trigger.kind == START


NEVER = math.inf  # onset [s] of a fault that does not occur
