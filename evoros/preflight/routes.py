"""Finds courses on which a robot cannot drive, or on which its controller avoids all the time."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.geometry.flooding import find_connected
from evoros.geometry.footprint import Footprint, distances, project_bodies
from evoros.preflight.subject import Subject, find_avoidance_range
from evoros.robot.model import Robot
from evoros.world.course import Course
from evoros.world.model import World

STEP_M = 0.25  # between places of the route whose free space is measured
MAX_RATIO = 3.0
"""The maximum ratio of the avoidance range to the free space at half of the route's places.

It is 2.5 in ``world=dense``, in which the evolved designs of the studies still make progress.
"""
FIT_RATIO = 2.0
"""The ratio that suits a course, which a message or a suggestion names."""
CELL_M = 0.1  # of the grid on which a way is searched
MAX_CELLS = 400  # along each side of that grid


def check_routes(subject: Subject) -> Iterator[str]:
    """Yield a warning for each fault of a course."""
    worlds: dict[str, list[str]] = {}
    for name, world in subject.world.items():
        for message in _check_world(subject, world):
            worlds.setdefault(message, []).append(f"world.{name}")
    for message, names in worlds.items():
        yield f"{', '.join(names)}: {message}"


def _check_world(subject: Subject, world: World) -> Iterator[str]:
    yield from check_route(world, subject.robot)
    fault = find_range_fault(world, subject.robot, subject.controller)
    if fault is not None:
        yield (
            f"half of the course lies within {fault.usual_m:.2g} m of an obstacle, but {fault.key} "
            f"is {fault.range_m:g} m, so that the robot avoids most of the time; lower it to about "
            f"{fault.better_m:.2g} m"
        )


def check_route(world: World, robot: Robot) -> Iterator[str]:
    """Yield a warning for each fault of the course of a world for a robot."""
    course, obstacles = world.course, project_bodies(world.obstacles, robot.height_m)
    yield from _check_spacing(course)
    if not obstacles:
        return
    half_width = float(np.abs(robot.outline[:, 1]).max())
    yield from _check_waypoints(course, obstacles, half_width)
    if world.sampler is None:  # a generated world has a passage
        yield from _check_passages(course, obstacles, half_width, robot.name)


@dataclass(frozen=True)
class RangeFault:
    """A range of the avoidance that is too long for the free space of a course."""

    key: str
    range_m: float
    usual_m: float  # free space at half of the route's places

    @property
    def better_m(self) -> float:
        """A range that fits."""
        return max(FIT_RATIO * self.usual_m, 0.1)


def find_range_fault(
    world: World, robot: Robot, controller: object, max_ratio: float = MAX_RATIO
) -> RangeFault | None:
    """Return the range with which a controller avoids all the time; None if it does not.

    ``max_ratio`` is the maximum ratio of the range to the free space at half of the places.
    """
    avoidance = find_avoidance_range(controller)
    obstacles = project_bodies(world.obstacles, robot.height_m)
    if avoidance is None or not obstacles:
        return None
    course = world.course
    legs = [
        a + (b - a) * np.linspace(0.0, 1.0, 1 + math.ceil(math.dist(a, b) / STEP_M))[:, None]
        for a, b in pairwise(course.first_phase)
    ]
    free = _free_space(np.concatenate(legs), obstacles)
    usual = float(np.median(free[free > 0.0])) if (free > 0.0).any() else 0.0
    return RangeFault(*avoidance, usual) if avoidance[1] > max_ratio * usual else None


def _check_spacing(course: Course) -> Iterator[str]:
    lengths = [math.dist(a, b) for a, b in pairwise(course.first_phase)]
    if min(lengths) <= course.acceptance_m:
        index = lengths.index(min(lengths))
        yield (
            f"leg {index + 1} of the course, {lengths[index]:.3g} m long, is complete at once, "
            f"because acceptance_m is {course.acceptance_m:g} m; lower course.acceptance_m, or "
            f"move the waypoints apart"
        )


def _check_waypoints(
    course: Course, obstacles: Sequence[Footprint], half_width: float
) -> Iterator[str]:
    free = _free_space(np.array(course.waypoints), obstacles)
    for point, distance in zip(course.waypoints, free.tolist(), strict=True):
        if distance + course.acceptance_m < half_width:
            yield (
                f"the robot, {2 * half_width:.3g} m wide, touches an obstacle before it is within "
                f"acceptance_m ({course.acceptance_m:g} m) of the waypoint ({_point(point)}); move "
                f"the waypoint, or raise course.acceptance_m"
            )


def _free_space(points: Array, obstacles: Sequence[Footprint]) -> Array:
    """Return the distance (n,) [m] of each point (n, 2) from the nearest obstacle."""
    free = np.full(len(points), np.inf)
    for footprint in obstacles:
        free = np.minimum(free, distances(footprint, points))
    return free


def _check_passages(
    course: Course, obstacles: Sequence[Footprint], half_width: float, robot: str
) -> Iterator[str]:
    """Look for a way to each waypoint that is as wide as the robot; rounding never hides one."""
    goals = np.array([course.home[:2], *course.waypoints])
    vertices = np.concatenate([goals, *(footprint.vertices for footprint in obstacles)])
    low, high = vertices.min(axis=0) - 2 * half_width - 1, vertices.max(axis=0) + 2 * half_width + 1
    cell = max(CELL_M, float((high - low).max()) / MAX_CELLS)
    free = _free_cells(low, high, cell, obstacles, half_width - cell / math.sqrt(2))
    home, reach = _cell(goals[0], low, cell), math.ceil(course.acceptance_m / cell)
    free[home] = True
    reached = find_connected(free, home)
    for point in course.waypoints:
        i, j = _cell(point, low, cell)
        if not reached[max(0, i - reach) : i + reach + 1, max(0, j - reach) : j + reach + 1].any():
            yield (
                f"no way between the obstacles is as wide as {robot} ({2 * half_width:.3g} m) and "
                f"leads from home to the waypoint ({_point(point)}); move the waypoint, or choose "
                f"a smaller robot"
            )


def _cell(point: Sequence[float] | Array, low: Array, cell: float) -> tuple[int, int]:
    return int((point[0] - low[0]) / cell), int((point[1] - low[1]) / cell)


def _free_cells(
    low: Array, high: Array, cell: float, obstacles: Sequence[Footprint], radius: float
) -> NDArray[np.bool_]:
    """Return which cells have their centre at least a radius [m] away from all obstacles."""
    columns, rows = (math.ceil(length / cell) for length in (high - low).tolist())
    free = np.ones((columns, rows), dtype=np.bool_)
    for footprint in obstacles:
        reach = footprint.radius + max(radius, 0.0) + cell
        first = np.floor((footprint.vertices.min(axis=0) - reach - low) / cell).astype(int)
        last = np.ceil((footprint.vertices.max(axis=0) + reach - low) / cell).astype(int)
        (i0, j0), (i1, j1) = np.clip(first, 0, None), np.minimum(last, (columns, rows))
        i, j = np.meshgrid(np.arange(i0, i1), np.arange(j0, j1), indexing="ij")
        centres = low + cell * (np.column_stack((i.ravel(), j.ravel())) + 0.5)
        near = distances(footprint, centres) < radius
        free[i0:i1, j0:j1] &= ~near.reshape(i.shape)
    return free


def _point(point: Sequence[float]) -> str:
    return f"{point[0]:g}, {point[1]:g}"
