"""The walkers of a mission, and the initial arrays of the rule that moves them."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple

import numpy as np

from evoros.base import checks
from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.base.packing import pack
from evoros.walkers import layout as at
from evoros.walkers.layout import REPORT_SIZE, Walk, Walking

MOST_WALKERS = 200  # maximum number of walkers per group; at each step, all interact in pairs


def _interval(text: str, holds: Callable[[Any], bool]) -> checks.Rule:
    def is_valid(value: Any) -> bool:
        ends = value if isinstance(value, list | tuple) else (value,)
        return checks.INTERVAL.holds(value) and all(map(holds, ends))

    return checks.Rule(f"{text}, or [low, high]", is_valid)


NUMBER = _interval(
    f"an integer from 0 to {MOST_WALKERS}", lambda v: checks.is_whole(v) and 0 <= v <= MOST_WALKERS
)
PACE = _interval("a number greater than 0 and at most 5", lambda v: 0.0 < v <= 5.0)
ROUTE = checks.Rule(
    "a list of at least two corners [x, y] that differ",
    lambda v: (
        isinstance(v, list | tuple)
        and all(
            isinstance(p, list | tuple) and len(p) == 2 and all(map(checks.is_number, p)) for p in v
        )
        and len({tuple(map(float, p)) for p in v}) > 1
    ),
)
RANDOM, EVEN = "random", "even"


@dataclass(frozen=True)
@checks.checked
class SocialForce:
    """The forces on a walker per unit mass (Helbing and Molnar, Phys. Rev. E 51, 4282, 1995).

    The defaults are the paper's, for points; here, distances are between walkers' surfaces.
    """

    relaxation_s: Annotated[float, checks.POSITIVE] = 0.5  # time constant of the desired speed
    repulsion_m2ps2: Annotated[float, checks.NOT_NEGATIVE] = 2.1  # potential of walkers in contact
    range_m: Annotated[float, checks.POSITIVE] = 0.3  # distance at which it falls to 1/e
    border_repulsion_m2ps2: Annotated[float, checks.NOT_NEGATIVE] = 10.0  # potential at obstacles
    border_range_m: Annotated[float, checks.POSITIVE] = 0.2


@dataclass(frozen=True)
@checks.checked
class Walkers:
    """A group of walkers, modelled as upright cylinders.

    Each walker follows the corners of its route, and returns from the last corner to the first.
    Without a ``route``, each mission draws a route through free space, out and back, for each
    walker.
    """

    number: Annotated[int | Sequence[int], NUMBER]  # [low, high]: drawn for each mission
    pace_mps: Annotated[float | Sequence[float], PACE] = 1.34  # [low, high]: drawn for each walker
    radius_m: Annotated[float, checks.number_between(0.1, 2.0)] = 0.25
    height_m: Annotated[float, checks.number_between(0.05, 10.0)] = 1.7
    route: Annotated[Sequence[Sequence[float]] | None, ROUTE] = None  # corners [m]
    phase: Annotated[str, checks.one_of(RANDOM, EVEN)] = RANDOM  # initial position along the route
    avoids_robots: Annotated[bool, checks.FLAG] = True  # True: robots repel the walkers
    stops_for_robots: Annotated[bool, checks.FLAG] = False
    stop_distance_m: Annotated[float, checks.POSITIVE] = 1.0  # gap to a robot at a stop
    patience_s: Annotated[float, checks.NOT_NEGATIVE] = 10.0  # maximum wait for a robot
    force: Annotated[SocialForce, checks.instance_of(SocialForce, "forces (SocialForce)")] = field(
        default_factory=SocialForce
    )

    def __post_init__(self) -> None:
        if self.route is not None:
            corners = tuple((float(x), float(y)) for x, y in self.route)
            ends = zip(corners, (*corners[1:], corners[0]), strict=True)
            if any(start == end for start, end in ends):
                rule = "must have different consecutive corners (the first follows the last)"
                raise checks.invalid(self, "route", self.route, rule)
            object.__setattr__(self, "route", corners)

    @property
    def numbers(self) -> tuple[int, int]:
        """The minimum and maximum number of walkers."""
        low, high = map(int, checks.bounds(self.number))
        return low, high

    @property
    def paces(self) -> tuple[float, float]:
        """The minimum and maximum pace [m/s]."""
        return checks.bounds(self.pace_mps)


WALKERS = checks.mapping_of(Walkers, "walkers (evoros.walkers.crowd.Walkers)")


AWAY_M = 1e5  # [m], distance at which walkers absent from the mission are placed, 10 m apart


class Walker(NamedTuple):
    """The parameters of a walker, and its state at the start of a mission."""

    name: str
    radius: float  # [m]
    height: float  # [m]
    corners: Array  # (k, CORNER_SIZE)
    place: tuple[float, float]  # [m]
    goal: int = 0  # index of the next corner
    pace: float = 0.0  # [m/s]
    group: Walkers | None = None  # None for an actor, which follows a script
    delay: float = 0.0  # [s], pause before each repetition of the script
    loops: bool = False  # True if the script is repeated
    present: bool = True


class Surroundings(NamedTuple):
    """The robots and obstacles around the walkers."""

    outlines: Sequence[Array]  # (k, 2) [m], outline of each robot in its frame
    borders: tuple[Array, ...]  # the fields ``grid`` to ``borders`` of ``Walk``


@dataclass(frozen=True, eq=False)
class Crowd:
    """The walkers of a mission, with their initial ``memory``."""

    names: tuple[str, ...]
    sizes: tuple[tuple[float, float], ...]  # radius and height [m] of each walker
    parameters: Array  # a packed Walk
    memory: Array  # a packed Walking

    @classmethod
    def of(cls, walkers: Sequence[Walker], around: Surroundings) -> "Crowd":
        """Convert walkers to arrays, in order."""
        rows = np.zeros((len(walkers), at.WALKER_SIZE))
        places = np.zeros((len(walkers), 2))
        motions = np.zeros((len(walkers), at.MOTION_SIZE))
        first = 0
        for i, walker in enumerate(walkers):
            end = first + len(walker.corners)
            rows[i] = _describe(walker, first, end)
            places[i] = walker.place if walker.present else (AWAY_M + 10.0 * i, AWAY_M)
            motions[i, at.GOAL] = first + walker.goal
            if walker.group is not None and walker.present:
                motions[i, : at.VELOCITY_Y + 1] = walker.pace * _find_heading(walker)
            first = end
        corners = [np.zeros((0, at.CORNER_SIZE)), *(walker.corners for walker in walkers)]
        ends = np.cumsum([0, *map(len, around.outlines)]).astype(np.float64)
        outlines = np.concatenate([np.zeros((0, 2)), *around.outlines])
        walk = Walk(rows, np.concatenate(corners), ends, outlines, *around.borders)
        names = tuple(walker.name for walker in walkers)
        sizes = tuple((walker.radius, walker.height) for walker in walkers)
        return cls(names, sizes, pack(walk), pack(Walking(places, motions)))


def _describe(walker: Walker, first: int, end: int) -> list[float]:
    group = walker.group
    kind, manners = at.ACTING, [0.0] * (at.DELAY - at.AVOIDS)
    if group is not None:
        kind, gap = at.WALKING, group.stop_distance_m if group.stops_for_robots else 0.0
        forces = vars(group.force).values()  # same order as the columns
        manners = [float(group.avoids_robots), gap, group.patience_s, *forces]
    kind = kind if walker.present else at.ABSENT
    route = [walker.radius, walker.pace, first, end, kind]
    return [*route, *manners, walker.delay, float(walker.loops)]


def _find_heading(walker: Walker) -> Array:
    way = walker.corners[walker.goal, :2] - np.array(walker.place)
    length = float(np.sqrt((way * way).sum()))
    return np.asarray(way / length if length > 0.0 else np.array([1.0, 0.0]))


@compilable
def report_walkers(now: Walking, reports: Array) -> None:
    """Write a report on each walker; the position of an absent walker is NaN."""
    for i in range(len(now.places)):
        away = now.places[i, 1] == AWAY_M
        reports[i * REPORT_SIZE + at.REPORT_X] = math.nan if away else now.places[i, 0]
        reports[i * REPORT_SIZE + at.REPORT_Y] = math.nan if away else now.places[i, 1]
        reports[i * REPORT_SIZE + at.REPORT_TOUCHED] = now.motions[i, at.TOUCHED]


@compilable
def note_touch(now: Walking, walker: int, robot: int) -> None:
    """Record that a walker has touched a robot."""
    touched = now.motions[walker, at.TOUCHED]
    bit = 1.0
    for _ in range(robot):
        bit *= 2.0
    if math.floor(touched / bit) % 2.0 == 0.0:
        now.motions[walker, at.TOUCHED] = touched + bit


def has_touched(report: float, robot: int) -> bool:
    """Return True if the walker of this report has touched a robot."""
    return bool(int(report) >> robot & 1)
