"""The description of walkers: how many walk through a world, where, how fast and how carefully."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

from evoros.base.checks import (
    FLAG,
    MOST,
    NOT_NEGATIVE,
    POSITIVE,
    Rule,
    checked,
    instance_of,
    invalid,
    is_number,
    is_whole,
    mapping_of,
    number_between,
    one_of,
)

MOST_WALKERS = 200
"""Walkers of one group: each meets all others in every step."""


def _is_range(value: object, holds: Rule) -> bool:
    """Whether a value keeps a rule, or is a list [low, high] of two that do."""
    if isinstance(value, list | tuple):
        return len(value) == 2 and all(map(holds.holds, value)) and value[0] <= value[1]
    return holds.holds(value)


_COUNTED = Rule("", lambda v: is_whole(v) and 0 <= v <= MOST_WALKERS)
_PACED = Rule("", lambda v: is_number(v) and 0.0 < v <= 5.0)
NUMBER = Rule(
    f"a whole number from 0 to {MOST_WALKERS}, or [low, high] of two",
    lambda v: _is_range(v, _COUNTED),
    limit=MOST,
)
PACE = Rule(
    "a number greater than 0 and at most 5, or [low, high] of two", lambda v: _is_range(v, _PACED)
)
ROUTE = Rule(
    "a list of at least two corners [x, y] that differ",
    lambda v: (
        isinstance(v, list | tuple)
        and all(isinstance(p, list | tuple) and len(p) == 2 and all(map(is_number, p)) for p in v)
        and len({tuple(map(float, p)) for p in v}) > 1
    ),
)
RANDOM, EVEN = "random", "even"


@dataclass(frozen=True)
@checked
class SocialForce:
    """The forces on a walker, per mass: Helbing and Molnar, Physical Review E 51, 4282 (1995).

    The defaults are the values of the paper. It gives them for people, whose places are points;
    here they hold for walkers of 0.25 m radius, and distances of others count from their surfaces.
    """

    relaxation_s: Annotated[float, POSITIVE] = 0.5  # in which a walker takes up its pace
    repulsion_m2ps2: Annotated[float, NOT_NEGATIVE] = 2.1  # potential between two walkers
    range_m: Annotated[float, POSITIVE] = 0.3  # in which that falls to 1/e
    border_repulsion_m2ps2: Annotated[float, NOT_NEGATIVE] = 10.0  # potential of obstacles
    border_range_m: Annotated[float, POSITIVE] = 0.2


@dataclass(frozen=True)
@checked
class Walkers:
    """A group of walkers, which are upright cylinders.

    Each walks round the corners of its route and from the last one to the first. Without a
    ``route``, each mission draws one for each walker, out and back through free space.

    Raises:
        InputError: a value out of range.
    """

    number: Annotated[int | Sequence[int], NUMBER]  # [low, high]: drawn in each mission
    pace_mps: Annotated[float | Sequence[float], PACE] = 1.34  # [low, high]: drawn for each
    radius_m: Annotated[float, number_between(0.1, 2.0)] = 0.25
    height_m: Annotated[float, number_between(0.05, 10.0)] = 1.7
    route: Annotated[Sequence[Sequence[float]] | None, ROUTE] = None  # corners [m]
    phase: Annotated[str, one_of(RANDOM, EVEN)] = RANDOM  # of the start on the route
    avoids_robots: Annotated[bool, FLAG] = True  # whether robots repel it
    stops_for_robots: Annotated[bool, FLAG] = False
    stop_distance_m: Annotated[float, POSITIVE] = 1.0  # from its surface to a robot's outline
    patience_s: Annotated[float, NOT_NEGATIVE] = 10.0  # after which it walks on around the robot
    force: Annotated[SocialForce, instance_of(SocialForce, "forces (SocialForce)")] = field(
        default_factory=SocialForce
    )

    def __post_init__(self) -> None:
        if self.route is not None:
            corners = tuple((float(x), float(y)) for x, y in self.route)
            ends = zip(corners, (*corners[1:], corners[0]), strict=True)
            if any(start == end for start, end in ends):
                raise invalid(self, "route", self.route, "a corner must not follow itself")
            object.__setattr__(self, "route", corners)

    @property
    def numbers(self) -> tuple[int, int]:
        """The smallest and the largest number of walkers."""
        low, high = self.number if isinstance(self.number, Sequence) else (self.number,) * 2
        return low, high

    @property
    def paces(self) -> tuple[float, float]:
        """The slowest and the fastest pace [m/s]."""
        low, high = self.pace_mps if isinstance(self.pace_mps, Sequence) else (self.pace_mps,) * 2
        return float(low), float(high)


WALKERS = mapping_of(Walkers, "walkers (evoros.walkers.walkers.Walkers)")
