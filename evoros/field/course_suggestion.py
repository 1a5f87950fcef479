"""Suggests a course for a world without one: straight legs clear of obstacles."""

import math
from collections.abc import Sequence
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.compilation.elementary_arrays import atan2_all
from evoros.geometry.footprint import Footprint, convex_hull, find_bounds
from evoros.geometry.free_space import CELL_M, FreeSpace, find_enclosed
from evoros.geometry.shapes import Pose, Shape
from evoros.world.course import Course

MAX_SLOPE = 0.25  # maximum slope, rise over run, of the ground under a course
_MOST_CELLS = 64  # maximum number of cells per side; finer height fields are coarsened
AROUND_M = 3.0  # maximum distance of a course from the obstacles' area, if there is no room inside


class Attempt(NamedTuple):
    """Search area and clearance of an attempt to find a course."""

    around_m: float  # margin outside the area of all obstacles
    margin_m: float  # free space on each side of the robot
    reach_m: float = 20.0  # half the side of the searched square, near the origin
    inside: bool = False  # whether to search only the largest enclosed region


class Suggestion(NamedTuple):
    """A course, and a description of its location."""

    course: Course
    place: str  # completes "The course lies ..."
    is_enclosed: bool  # whether the course is in the largest enclosed region


ATTEMPTS = (
    Attempt(0.0, 0.2, 60.0, inside=True),
    Attempt(0.0, 0.05, 60.0, inside=True),
    Attempt(0.0, 0.2),
    Attempt(AROUND_M, 1.0),
    Attempt(AROUND_M, 0.2),
    Attempt(AROUND_M, 0.05),
    Attempt(AROUND_M, 0.2, 60.0),
)
OPEN_SIDE_M = 3.0  # half the side of the square suggested on open ground
LOOP = 4  # minimum number of corners, including home, of a loop
SHORTEST_LEG_M, LONGEST_LEG_M = 1.5, 8.0
SHORTER = 2.0  # minimum leg length in acceptance radii if longer legs form no loop
HOMES, CORNERS, TRIES = 12, 60, 4000
LARGE_ENOUGH_M = 24.0  # size of a loop below which other homes are tried
ROOM_M = 12.0  # size of a loop below which other attempts are made
SHARES = np.linspace(0.0, 1.0, 9)  # fractions of a leg at which the clearance is checked
THIN = 0.02  # area over squared length below which a loop is nearly a line; a square has 0.06
STRAIGHT = 0.7  # maximum absolute cosine of the angle between two legs
MEETING_M, MISSING = 2.0, 0.2  # maximum distance of a loop from an obstacle; weight if farther
DETOUR = 3.0  # required growth of a loop per metre of distance from home to the origin
HEIGHT_M = 0.02  # height of the robot's frame above the ground at the start
CRUISE_MPS = 0.15  # average speed, including avoidance, for the time limit


def suggest_course(
    footprints: Sequence[Footprint],
    robot_radius_m: float,
    ground: Sequence[Footprint] | None = None,
    home: tuple[float, float] | None = None,
) -> Suggestion | None:
    """Suggest home and up to four waypoints connected by clear straight legs.

    ``footprints`` are the obstacles that the robot can touch. The course stays on ``ground`` (None:
    unbounded), and starts at ``home`` if given. If there is room, the course lies in the largest
    enclosed free region; in an empty unbounded world, it is a small square around the origin. The
    result is None if there is no room for two mutually visible points.
    """
    route = _find_widest_route(footprints, robot_radius_m, ground, home)
    if route is None:
        return None
    course = create_course(route.corners.tolist(), robot_radius_m)
    return Suggestion(course, route.place, route.is_enclosed)


class _Route(NamedTuple):
    value: float  # the higher, the better
    corners: Array  # (n, 2) [m], home first
    place: str = ""
    is_enclosed: bool = False


def _accept_within(radius_m: float) -> float:
    return round(min(1.0, max(0.3, radius_m)), 2)


def create_course(route: Sequence[Sequence[float]], robot_radius_m: float) -> Course:
    """Return a course for a slow robot of this radius on a route (n, 2) [m] that starts at home."""
    (home_x, home_y), (x, y) = route[0], route[1]
    length = 2.0 * sum(math.dist(a, b) for a, b in pairwise([*route, route[0]]))
    return Course(
        home_x_m=round(home_x, 2),
        home_y_m=round(home_y, 2),
        home_z_m=HEIGHT_M,
        home_yaw_rad=round(elementary.atan2(y - home_y, x - home_x), 3),
        waypoints=[[round(x, 2), round(y, 2)] for x, y in route[1:]],
        acceptance_m=_accept_within(robot_radius_m),
        time_limit_s=60.0 * math.ceil(length / CRUISE_MPS / 60.0),
        direction="random",
        end_on_collision=True,
    )


def _find_widest_route(
    footprints: Sequence[Footprint],
    radius_m: float,
    ground: Sequence[Footprint] | None,
    home: tuple[float, float] | None,
) -> _Route | None:
    """Find a route inside walls, else among the obstacles, else around them."""
    if not footprints and ground is None:
        corners = OPEN_SIDE_M * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
        square = np.vstack(((0.0, 0.0) if home is None else home, corners))
        return _Route(0.0, square, "on open ground without obstacles")
    best, inside = None, False
    spacings = SHORTEST_LEG_M, min(SHORTEST_LEG_M, SHORTER * _accept_within(radius_m))
    for attempt in ATTEMPTS:
        if best is not None and (best.value >= ROOM_M or (inside and not attempt.inside)):
            break
        inside = attempt.inside
        space = _find_free(footprints, radius_m, attempt, ground, home)
        free = find_enclosed(space.free) if inside else space.free
        if free is None:
            continue
        route = _find_route(FreeSpace(space.low, free), home, spacings, np.random.default_rng(0))
        if route is None:
            continue
        # A line with less room on each side is no better than a loop, however long it is.
        is_open = best is None or len(route.corners) >= min(len(best.corners), LOOP)
        if is_open and (best is None or route.value > best.value):
            where = _describe(attempt, float(free.sum()))
            best = route._replace(place=where, is_enclosed=inside)
    return best


def _describe(attempt: Attempt, cells: float) -> str:
    if attempt.inside:
        area = f"{cells * CELL_M * CELL_M:.3g} m2"
        return f"in the largest enclosed free region, where the robot's centre can move over {area}"
    if not attempt.around_m:
        return "among the obstacles: no enclosed free region is large enough"
    return f"among the obstacles and up to {attempt.around_m:g} m around them (no room inside)"


def _find_free(
    footprints: Sequence[Footprint],
    radius_m: float,
    attempt: Attempt,
    ground: Sequence[Footprint] | None,
    home: tuple[float, float] | None,
) -> FreeSpace:
    low, high = find_bounds(*(footprints or ground or ()))
    if home is not None:
        low, high = np.minimum(low, home), np.maximum(high, home)
    middle, wanted = (low + high) / 2, np.array(home or (0.0, 0.0))
    if home is None and np.abs(middle).max() < attempt.reach_m / 2:
        middle = wanted  # worlds are usually built around their origin
    else:  # point of the area nearest to home or the origin
        ends = np.minimum(low + attempt.reach_m, middle), np.maximum(high - attempt.reach_m, middle)
        middle = np.clip(wanted, *ends)
    low = np.maximum(low - attempt.around_m, middle - attempt.reach_m)
    high = np.minimum(high + attempt.around_m, middle + attempt.reach_m)
    return FreeSpace.within(low, high, footprints, radius_m + attempt.margin_m, ground)


def _find_route(
    space: FreeSpace, given: tuple[float, float] | None, spacings: tuple[float, ...], rng: Generator
) -> _Route | None:
    centres = space.centres()
    if len(centres) < 2:
        return None
    by_distance = centres[np.argsort(np.linalg.norm(centres, axis=1), kind="stable")]
    nearest = float(np.linalg.norm(by_distance[0]))
    homes = by_distance[[0, *np.sort(rng.integers(len(centres), size=HOMES))]]
    if space.is_open(np.zeros(2), np.zeros(2)):
        homes[0] = 0.0
    if given is not None:
        homes = np.array([given])
    best: _Route | None = None
    for home in homes:
        near = centres[np.linalg.norm(centres - home, axis=1) < 2.0 * LONGEST_LEG_M]
        if not len(near):
            continue
        chosen = near[rng.integers(len(near), size=CORNERS)]
        loop = _find_loop(space, np.vstack((home, chosen)), spacings, rng)
        if loop is None:
            continue
        value = loop.value - DETOUR * (float(np.linalg.norm(home)) - nearest)
        if best is None or value > best.value:
            best = loop._replace(value=value)
        if best.value >= LARGE_ENOUGH_M:
            break
    return best


def _find_loop(
    space: FreeSpace, points: Array, spacings: tuple[float, ...], rng: Generator
) -> _Route | None:
    """Find a wide loop through the first of ``points`` (n, 2) [m] and four others, if possible.

    The corners are at least the first of ``spacings`` [m] apart, else the second. Loops rank by
    length [m] plus area [m2]; loops without obstacles nearby come last.
    """
    lengths = np.linalg.norm(points[:, None] - points[None], axis=2)
    near = (lengths >= min(spacings)) & (lengths <= LONGEST_LEG_M)
    for i, j in zip(*np.nonzero(np.triu(near)), strict=True):
        near[i, j] = near[j, i] = space.is_open(points[i], points[j])
    for spacing, count in (*product(spacings, (4, 3, 2)), *product(spacings, (1,))):
        legs = near & (lengths >= spacing)
        picks = rng.integers(1, len(points), size=(TRIES, count))
        loops = _order_around(points, np.hstack((np.zeros((TRIES, 1), dtype=np.int64), picks)))
        starts, ends = loops, np.roll(loops, -1, axis=1)
        spread = _narrowest_gap(lengths, picks)
        valid = legs[starts, ends].all(axis=1) & (spread >= spacing)
        if valid.any():
            starts, ends = points[loops[valid]], points[np.roll(loops, -1, axis=1)[valid]]
            area, around = _enclosed_area(starts), np.linalg.norm(ends - starts, axis=2).sum(axis=1)
            size = area + around
            along = starts + SHARES[:, None, None, None] * (ends - starts)
            meets = (space.measure_clearance(along) <= MEETING_M).any(axis=(0, 2))
            size = np.where(meets, size, MISSING * size)
            largest = int(size.argmax())
            loop = _Route(float(size[largest]), starts[largest])
            if area[largest] >= THIN * around[largest] ** 2:
                return loop
            turn = _find_turn(points, lengths, legs, spacing)
            return turn if turn is not None and turn.value > loop.value else loop
    return None


def _find_turn(
    points: Array, lengths: Array, legs: NDArray[np.bool_], spacing: float
) -> _Route | None:
    """Find the longest route [m] along two legs around a corner and back; None if there is none."""
    out, on = points - points[0], points[None] - points[:, None]
    along = np.abs((out[:, None] * on).sum(axis=2))
    turns = along <= STRAIGHT * lengths[0][:, None] * lengths
    valid = legs[0][:, None] & legs & turns & (lengths[0] >= spacing)
    total = np.where(valid, 2.0 * (lengths[0][:, None] + lengths), 0.0)
    corner, end = divmod(int(total.argmax()), len(points))
    route = _Route(float(total[corner, end]), points[[0, corner, end, corner]])
    return route if valid.any() else None


def _order_around(points: Array, loops: NDArray[np.int64]) -> NDArray[np.int64]:
    """Sort the points of each loop (n, k) by bearing from its centroid, so that no legs cross."""
    places = points[loops]
    offsets = places - places.mean(axis=1, keepdims=True)
    order = np.argsort(atan2_all(offsets[:, :, 1], offsets[:, :, 0]), axis=1, kind="stable")
    first = np.argmin(order, axis=1)
    turns = (first[:, None] + np.arange(loops.shape[1])) % loops.shape[1]
    return np.take_along_axis(loops, np.take_along_axis(order, turns, axis=1), axis=1)


def _enclosed_area(loops: Array) -> Array:
    """Return the areas (n,) [m2] of polygons (n, k, 2) by the shoelace formula."""
    following = np.roll(loops, -1, axis=1)
    twice = loops[:, :, 0] * following[:, :, 1] - loops[:, :, 1] * following[:, :, 0]
    return np.asarray(np.abs(twice.sum(axis=1)) / 2.0)


def _narrowest_gap(lengths: Array, picks: NDArray[np.int64]) -> Array:
    """Return the minimum distance [m] between two points of each loop."""
    gaps = lengths[picks[:, :, None], picks[:, None, :]]
    return np.asarray(np.where(np.eye(picks.shape[1]), np.inf, gaps).min(axis=(1, 2)))


def find_steep_places(field: Shape, pose: Pose) -> list[Footprint]:
    """Return rectangles that cover all height field cells with steep edges."""
    heights = np.array(field.heights, dtype=np.float64)
    rows, columns = (count - 1 for count in heights.shape)
    length_x, length_y = field.size
    along_x = np.abs(np.diff(heights, axis=1)) > MAX_SLOPE * length_x / columns
    along_y = np.abs(np.diff(heights, axis=0)) > MAX_SLOPE * length_y / rows
    steep = along_x[:-1] | along_x[1:] | along_y[:, :-1] | along_y[:, 1:]
    step = -(-max(rows, columns) // _MOST_CELLS)
    places = []
    for row in range(0, rows, step):
        strip = steep[row : row + step].any(axis=0)
        ends = np.flatnonzero(np.diff(np.r_[False, strip, False].astype(int)))
        for first, last in ends.reshape(-1, 2).tolist():
            x = [length_x * (column / columns - 0.5) for column in (first, last)]
            y = [length_y * (edge / rows - 0.5) for edge in (row, min(row + step, rows))]
            corners = [pose.transform((a, b, 0.0))[:2] for a in x for b in y]
            places.append(Footprint(convex_hull(np.array(corners))))
    return places
