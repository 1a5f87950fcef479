"""Draws the walkers of a mission at random."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.geometry.footprint import Outlines, distances, find_bounds
from evoros.geometry.free_space import FreeSpace, find_connected
from evoros.geometry.grid import Grid
from evoros.geometry.polygon import find_border, polygon_distance
from evoros.walkers.crowd import RANDOM, Crowd, Surroundings, Walker, Walkers
from evoros.walkers.forces import FOREIGN_REACH_M
from evoros.walkers.layout import CORNER_S, CORNER_SIZE
from evoros.world.floors import project_ground
from evoros.world.model import World
from evoros.world.standing import join_areas, list_areas

MARGIN_M = 0.1  # minimum distance [m] from drawn routes to obstacles
AROUND_M = 2.0  # maximum distance [m] of walkers from the area of obstacles and course


@lru_cache(maxsize=64)
def lay_out_borders(world: World, height: float) -> tuple[Array, ...]:
    """Return the obstacles below a height [m] as arrays for the rule that moves walkers."""
    areas = join_areas(world, height)
    grid, outlines = Grid.around(areas, FOREIGN_REACH_M), Outlines.of(areas)
    return grid.to_array(), *grid.list_near(areas, FOREIGN_REACH_M), outlines.rows, outlines.corners


@lru_cache(maxsize=64)
def find_free_space(world: World, radius: float, height: float) -> FreeSpace:
    """Return the free positions for a walker's centre that are connected to home."""
    areas = join_areas(world, height)
    course = world.course
    points = np.array([course.home[:2], *course.waypoints])
    low, high = points.min(axis=0), points.max(axis=0)
    if areas:
        bounds = find_bounds(*areas)
        low, high = np.minimum(low, bounds[0]), np.maximum(high, bounds[1])
    low, high = low - AROUND_M, high + AROUND_M
    space = FreeSpace.within(low, high, areas, radius + MARGIN_M, project_ground(world.bodies))
    if not space.free.any():
        raise InputError(f"has no room for a walker of radius {radius:g} m")
    centres = space.centres() - points[0]
    nearest = int((centres * centres).sum(axis=1).argmin())
    row, column = np.argwhere(space.free)[nearest].tolist()
    return FreeSpace(space.low, find_connected(space.free, (row, column)))


def find_blocking(
    world: World, legs: Sequence[Sequence[Sequence[float]]], radius: float, height: float
) -> tuple[str, Sequence[Sequence[float]]] | None:
    """Return the name of the first obstacle on a straight leg, and the leg; None if all free."""
    ways = [(leg, np.array(leg, dtype=np.float64)) for leg in legs]
    for body, areas in list_areas(world, height):
        for area in areas:
            low, high = find_bounds(area)
            reach = radius + area.radius
            for leg, way in ways:
                gaps = np.maximum(low - way.max(axis=0), way.min(axis=0) - high)
                if gaps.max() < radius and (
                    distances(area, way).min() < radius
                    or polygon_distance(area.vertices, way, reach) < reach
                ):
                    return body.name, leg
    return None


def measure_legs(corners: Array) -> Array:
    """Return the leg lengths [m] of a closed route (n, 2), including the closing leg."""
    legs = np.roll(corners, -1, axis=0) - corners
    return np.array([math.hypot(x, y) for x, y in legs.tolist()])


MAX_DRAWS = 200  # maximum number of routes or positions tried per walker
MIN_LEG_M = 1.0
CORNERS = 2, 4  # minimum and maximum number of corners on the way out of a drawn route
CLEAR_M = 0.5  # minimum distance [m] from a walker's surface to a robot at the start
APART_M = 0.05  # minimum distance [m] between the surfaces of two walkers at the start


class Standing(NamedTuple):
    """The outline and home pose of a robot, in top view."""

    outline: Array  # (k, 2) [m], in the robot's frame
    home: tuple[float, float, float]  # x, y [m], yaw [rad]


def advise(name: str, walkers: Mapping[str, Walkers]) -> str:
    """Return advice on removing the people from a world."""
    return "set walkers=none" if walkers else f"set ++world.{name}.actors=leave_out"


def check_walkers(world: World, name: str, walkers: Mapping[str, Walkers]) -> None:
    """Check that walkers can walk in a world."""
    if (walkers or world.actors) and not world.is_level:
        raise InputError(
            f"walkers: world.{name} must have level ground, not a height field or a tilted plane; "
            f"{advise(name, walkers)}"
        )
    for group, part in walkers.items():
        if part.route is None:
            continue
        if world.sampler is not None:
            raise InputError(
                f"walkers.{group}.route: must be null, not {[*map(list, part.route)]}, because "
                f"world.{name} is drawn for each mission; set it to null to draw the routes as well"
            )
        legs = [*zip(part.route, [*part.route[1:], part.route[0]], strict=True)]
        blocked = find_blocking(world, legs, part.radius_m, part.height_m)
        if blocked is not None:
            body, ((ax, ay), (bx, by)) = blocked
            raise InputError(
                f"walkers.{group}.route: each leg must be clear for a radius of "
                f"{part.radius_m:g} m, but the obstacle {body!r} of world.{name} blocks the leg "
                f"from ({ax:g}, {ay:g}) to ({bx:g}, {by:g}); move a corner"
            )


def draw_crowd(
    world: World,
    walkers: Mapping[str, Walkers],
    robots: Sequence[Standing],
    draws: Callable[[str], Generator],
) -> Crowd:
    """Draw the walkers of a mission (streams ``walkers.NAME``); the world's actors come last."""
    drawn: list[Walker] = []
    for name, group in walkers.items():
        drawn += _draw_group(world, name, group, robots, drawn, draws(f"walkers.{name}"))
    for actor in world.actors:
        points = np.array(actor.points, dtype=np.float64)
        start = float(points[0, 0]), float(points[0, 1])
        script = actor.delay_s, actor.loops
        size = actor.radius_m, actor.height_m
        drawn.append(Walker(actor.name, *size, points, start, 0, 0.0, None, *script))
    tallest = max((walker.height for walker in drawn), default=1.0)
    outlines = [robot.outline for robot in robots]
    return Crowd.of(drawn, Surroundings(outlines, lay_out_borders(world, tallest)))


def name_walkers(walkers: Mapping[str, Walkers], world: World) -> list[str]:
    """Return the names of all walkers that missions may contain, in order."""
    groups = [f"{name}_{i}" for name, group in walkers.items() for i in range(group.numbers[1])]
    return [*groups, *(actor.name for actor in world.actors)]


def _draw_group(
    world: World,
    name: str,
    group: Walkers,
    robots: Sequence[Standing],
    others: Sequence[Walker],
    rng: Generator,
) -> Iterator[Walker]:
    low, high = group.numbers
    count = low if low == high else int(rng.integers(low, high + 1))
    placed = [other for other in others if other.present]
    size = group.radius_m, group.height_m
    nowhere = np.zeros((1, CORNER_SIZE))
    for i in range(high):
        if i >= count:
            yield Walker(f"{name}_{i}", *size, nowhere, (0.0, 0.0), group=group, present=False)
            continue
        slowest, fastest = group.paces
        pace = slowest if slowest == fastest else float(rng.uniform(slowest, fastest))
        tries = _propose(world, name, group, (i, count), rng)
        fits = (start for start in tries if _is_clear(start, group, robots, placed))
        found = next(fits, None)
        if found is None:
            raise InputError(
                f"walkers.{name}.number: the world {world.name!r} has room for only {i} of {count} "
                f"walkers to start apart from each other and from the robots; lower this number "
                f"or walkers.{name}.radius_m, or move walkers.{name}.route"
            )
        corners, goal, place = found
        placed.append(Walker(f"{name}_{i}", *size, corners, place, goal, pace, group))
        yield placed[-1]


_Start = tuple[Array, int, tuple[float, float]]  # corners, index of first goal, position [m]


def _propose(
    world: World, name: str, group: Walkers, place: tuple[int, int], rng: Generator
) -> Iterator[_Start]:
    """Yield candidate starts of a walker; ``place`` is its index and the number of walkers."""
    for try_ in range(MAX_DRAWS):
        corners = _draw_route(world, name, group, rng) if group.route is None else group.route
        if corners is None:
            continue
        points = np.zeros((len(corners), CORNER_SIZE))
        points[:, :CORNER_S] = corners
        # Each attempt shifts the start along the route, away from an occupied position.
        even = (place[0] / place[1] + try_ / MAX_DRAWS) % 1.0
        share = float(rng.random()) if group.phase == RANDOM else even
        yield points, *_start_at(points[:, :CORNER_S], share)


def _start_at(corners: Array, share: float) -> tuple[int, tuple[float, float]]:
    """Return the index of the next corner, and the position at a fraction of a closed route."""
    lengths = measure_legs(corners)
    left = share * float(lengths.sum())
    for i, length in enumerate(lengths.tolist()):
        if left <= length or i == len(lengths) - 1:
            goal = (i + 1) % len(corners)
            x, y = corners[i] + min(left / length, 1.0) * (corners[goal] - corners[i])
            return goal, (float(x), float(y))
        left -= length
    raise AssertionError


def _is_clear(
    start: _Start, group: Walkers, robots: Sequence[Standing], placed: Sequence[Walker]
) -> bool:
    x, y = start[2]
    for walker in placed:
        gap = math.dist(walker.place, (x, y)) - walker.radius - group.radius_m
        if gap < APART_M:
            return False
    for outline, (home_x, home_y, yaw) in robots:
        sin, cos = elementary.sin_cos(yaw)
        dx, dy = x - home_x, y - home_y
        distance, _, _ = find_border(outline, cos * dx + sin * dy, cos * dy - sin * dx)
        if distance - group.radius_m < CLEAR_M:
            return False
    return True


def _draw_route(world: World, name: str, group: Walkers, rng: Generator) -> Array | None:
    """Draw corners (n, 2) [m] of a way out and back in free space; None if no leg was found."""
    try:
        space = find_free_space(world, group.radius_m, group.height_m)
    except InputError as error:
        problem = f"the world {world.name!r} {error}; lower walkers.{name}.radius_m"
        raise InputError(f"walkers.{name}: {problem}") from None
    centres = space.centres()
    count = int(rng.integers(CORNERS[0], CORNERS[1] + 1))
    corners = [centres[int(rng.integers(len(centres)))]]
    for _ in range(MAX_DRAWS):
        point = centres[int(rng.integers(len(centres)))]
        if math.dist(point, corners[-1]) >= MIN_LEG_M and space.is_open(corners[-1], point):
            corners.append(point)
        if len(corners) == count:
            break
    return np.array([*corners, *corners[-2:0:-1]]) if len(corners) > 1 else None
