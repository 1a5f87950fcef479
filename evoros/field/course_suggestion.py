"""Suggests a course in a world that has none: straight legs on which a robot meets no obstacle."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.compilation.elementary_arrays import atan2_all
from evoros.geometry.footprint import Footprint, find_bounds
from evoros.geometry.free_space import FreeSpace
from evoros.world.course import Course

AROUND_M = 3.0
"""How far outside of all obstacles a course may lead, if it finds too little room among them."""


class Attempt(NamedTuple):
    """Where a course is looked for."""

    around_m: float  # outside of all obstacles
    margin_m: float  # free space beside the robot
    reach_m: float = 20.0  # from the middle of a large world


ATTEMPTS = (
    Attempt(0.0, 0.2),
    Attempt(AROUND_M, 1.0),
    Attempt(AROUND_M, 0.2),
    Attempt(AROUND_M, 0.05),
    Attempt(AROUND_M, 0.2, 60.0),
)
OPEN_SIDE_M = 3.0  # half the side of the square that is suggested among no obstacles
SHORTEST_LEG_M, LONGEST_LEG_M = 1.5, 8.0
HOMES, CORNERS, TRIES = 12, 60, 4000
LARGE_ENOUGH_M = 24.0  # size of a loop, below which other homes are tried
ROOM_M = 12.0  # size of a loop, below which other attempts are made
DETOUR = 3.0  # how much larger a loop must be for each metre that its home is off the origin
HEIGHT_M = 0.02  # of the robot's frame above the ground when it is set down
CRUISE_MPS = 0.15  # average speed, with avoidance, for which the time limit allows


def suggest_course(
    footprints: Sequence[Footprint],
    robot_radius_m: float,
    ground: Sequence[Footprint] | None = None,
    home: tuple[float, float] | None = None,
) -> Course | None:
    """Suggest home and up to four waypoints with free straight lines between them.

    All obstacles that the robot can touch have ``footprints``. The course stays on the ``ground``,
    which has no end if it is None, and starts at ``home`` if that is given. The suggestion is
    deterministic. It is a small square around the origin if nothing stands in a world
    without end, and None if there is no room for two points that see each other.
    """
    route = _find_widest_route(footprints, robot_radius_m, ground, home)
    return None if route is None else create_course(route.tolist(), robot_radius_m)


def create_course(route: Sequence[Sequence[float]], robot_radius_m: float) -> Course:
    """Return the course along a route (n, 2) [m] from home, with all its other values.

    They allow for a slow robot of this radius, which starts towards the first corner.
    """
    (home_x, home_y), (x, y) = route[0], route[1]
    length = 2.0 * sum(math.dist(a, b) for a, b in pairwise([*route, route[0]]))
    return Course(
        home_x_m=round(home_x, 2),
        home_y_m=round(home_y, 2),
        home_z_m=HEIGHT_M,
        home_yaw_rad=round(elementary.atan2(y - home_y, x - home_x), 3),
        waypoints=[[round(x, 2), round(y, 2)] for x, y in route[1:]],
        acceptance_m=round(min(1.0, max(0.3, robot_radius_m)), 2),
        time_limit_s=60.0 * math.ceil(length / CRUISE_MPS / 60.0),
        direction="random",
        end_on_collision=True,
    )


def _find_widest_route(
    footprints: Sequence[Footprint],
    radius_m: float,
    ground: Sequence[Footprint] | None,
    home: tuple[float, float] | None,
) -> Array | None:
    """Find a route among the obstacles, or around them if there is too little room."""
    if not footprints and ground is None:
        corners = OPEN_SIDE_M * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
        return np.vstack(((0.0, 0.0) if home is None else home, corners))
    best: tuple[float, Array] | None = None
    for attempt in ATTEMPTS:
        space = _find_free(footprints, radius_m, attempt, ground, home)
        route = _find_route(space, home, np.random.default_rng(0))
        if route is not None and (best is None or route[0] > best[0]):
            best = route
        if best is not None and best[0] >= ROOM_M:
            break
    return None if best is None else best[1]


def _find_free(
    footprints: Sequence[Footprint],
    radius_m: float,
    attempt: Attempt,
    ground: Sequence[Footprint] | None,
    home: tuple[float, float] | None,
) -> FreeSpace:
    """Return the free space among the obstacles and around them, or on the ground without any."""
    low, high = find_bounds(*(footprints or ground or ()))
    if home is not None:
        low, high = np.minimum(low, home), np.maximum(high, home)
    middle = (low + high) / 2
    if np.abs(middle).max() < attempt.reach_m / 2:
        middle = np.zeros(2)  # worlds are usually built around their origin
    low = np.maximum(low - attempt.around_m, middle - attempt.reach_m)
    high = np.minimum(high + attempt.around_m, middle + attempt.reach_m)
    return FreeSpace.within(low, high, footprints, radius_m + attempt.margin_m, ground)


def _find_route(
    space: FreeSpace, given: tuple[float, float] | None, rng: Generator
) -> tuple[float, Array] | None:
    """Find home and corners (n, 2) [m] that form a long loop of open legs, and how good it is."""
    centres = space.centres()
    if len(centres) < 2:
        return None
    by_distance = centres[np.argsort(np.linalg.norm(centres, axis=1), kind="stable")]
    homes = by_distance[[0, *np.sort(rng.integers(len(centres), size=HOMES))]]
    if space.is_open(np.zeros(2), np.zeros(2)):
        homes[0] = 0.0
    if given is not None:
        homes = np.array([given])
    best: tuple[float, Array] | None = None
    for home in homes:
        near = centres[np.linalg.norm(centres - home, axis=1) < 2.0 * LONGEST_LEG_M]
        if not len(near):
            continue
        chosen = near[rng.integers(len(near), size=CORNERS)]
        loop = _find_loop(space, np.vstack((home, chosen)), rng)
        if loop is None:
            continue
        value = loop[0] - DETOUR * float(np.linalg.norm(home))
        if best is None or value > best[0]:
            best = value, loop[1]
        if best[0] >= LARGE_ENOUGH_M:
            break
    return best


def _find_loop(space: FreeSpace, points: Array, rng: Generator) -> tuple[float, Array] | None:
    """Find a wide loop over the first of ``points`` (n, 2) [m] and 4, else 3, 2 or 1 others.

    Returns its size and its corners. The size is its length [m] plus its area [m2], so that loops
    that go round something come before those that lead to and fro.
    """
    lengths = np.linalg.norm(points[:, None] - points[None], axis=2)
    legs = (lengths >= SHORTEST_LEG_M) & (lengths <= LONGEST_LEG_M)
    for i, j in zip(*np.nonzero(np.triu(legs)), strict=True):
        legs[i, j] = legs[j, i] = space.is_open(points[i], points[j])
    for count in (4, 3, 2, 1):
        picks = rng.integers(1, len(points), size=(TRIES, count))
        loops = _order_around(points, np.hstack((np.zeros((TRIES, 1), dtype=np.int64), picks)))
        starts, ends = loops, np.roll(loops, -1, axis=1)
        spread = _narrowest_gap(lengths, picks)
        valid = legs[starts, ends].all(axis=1) & (spread >= SHORTEST_LEG_M)
        if valid.any():
            size = _enclosed_area(points[loops]) + lengths[starts, ends].sum(axis=1)
            largest = int(np.where(valid, size, -1.0).argmax())
            return float(size[largest]), points[loops[largest]]
    return None


def _order_around(points: Array, loops: NDArray[np.int64]) -> NDArray[np.int64]:
    """Order each loop (n, k) by the bearing from its middle, from point 0 on: no legs cross."""
    places = points[loops]
    offsets = places - places.mean(axis=1, keepdims=True)
    order = np.argsort(atan2_all(offsets[:, :, 1], offsets[:, :, 0]), axis=1, kind="stable")
    first = np.argmin(order, axis=1)
    turns = (first[:, None] + np.arange(loops.shape[1])) % loops.shape[1]
    return np.take_along_axis(loops, np.take_along_axis(order, turns, axis=1), axis=1)


def _enclosed_area(loops: Array) -> Array:
    """Return the area (n,) [m2] inside closed loops (n, k, 2), by the shoelace formula."""
    following = np.roll(loops, -1, axis=1)
    twice = loops[:, :, 0] * following[:, :, 1] - loops[:, :, 1] * following[:, :, 0]
    area: Array = np.abs(twice.sum(axis=1)) / 2.0
    return area


def _narrowest_gap(lengths: Array, picks: NDArray[np.int64]) -> Array:
    """Return the smallest distance [m] between any two of the picked points of each loop."""
    gaps = lengths[picks[:, :, None], picks[:, None, :]]
    diagonal = np.eye(picks.shape[1], dtype=np.bool_)
    smallest: Array = np.where(diagonal[None], np.inf, gaps).min(axis=(1, 2))
    return smallest
