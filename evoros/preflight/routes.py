"""Checks courses: bodies at home, narrow passages, constant avoidance."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.geometry.clearance import compute_clearances
from evoros.geometry.footprint import (
    Footprint,
    distances,
    find_bounds,
    lowest_point,
    project_bodies,
)
from evoros.geometry.free_space import FreeSpace, find_connected
from evoros.geometry.shapes import Body
from evoros.preflight.scene import Subject, find_avoidance_range
from evoros.robot.model import Robot
from evoros.world.course import Course
from evoros.world.floors import ground_height
from evoros.world.model import World
from evoros.world.standing import GAP_M, join_areas, standing_obstacles

_STANDING_IN = 0.1  # fraction by which the outline shrinks to test if a robot is in an obstacle
_MOVE = "move the body, or home (course.home_x_m, course.home_y_m)"
STEP_M = 0.25  # distance [m] between sampled points of the route
MAX_RATIO = 3.0  # maximum ratio of avoidance range to free space; 2.5 in world=dense still works
FIT_RATIO = 2.0  # ratio suggested in warnings
CELL_M = 0.1  # cell size [m] of the search grid
MAX_CELLS = 400  # maximum number of cells per side of the grid


def check_routes(subject: Subject) -> Iterator[str]:
    """Yield a warning for each fault of a course."""
    worlds: dict[str, list[str]] = {}
    for name, world in subject.scenario.world.items():
        for message in _check_world(subject, world):
            worlds.setdefault(message, []).append(f"world.{name}")
    for message, names in worlds.items():
        yield f"{', '.join(names)}: {message}"


def _check_world(subject: Subject, world: World) -> Iterator[str]:
    yield from check_route(world, subject.member.robot)
    fault = find_range_fault(world, subject.member.robot, subject.member.controller)
    if fault is not None:
        yield (
            f"half of the course lies within {fault.usual_m:.2g} m of an obstacle, but {fault.key} "
            f"is {fault.range_m:g} m, so the robot avoids obstacles most of the time; lower this "
            f"range to about {fault.better_m:.2g} m"
        )


def check_route(world: World, robot: Robot) -> Iterator[str]:
    """Yield a warning for each fault of a world's course for a robot."""
    course, obstacles = world.course, join_areas(world, robot.height_m)
    yield from _check_spacing(course)
    if not obstacles:
        return
    half_width = float(np.abs(robot.outline[:, 1]).max())
    yield from _check_waypoints(course, obstacles, half_width)
    if world.sampler is None:  # generated worlds always have a passage
        yield from _check_passages(course, obstacles, half_width, robot.name)


class RangeFault(NamedTuple):
    """An avoidance range that exceeds the free space along a course."""

    key: str
    range_m: float
    usual_m: float  # median free space along the route

    @property
    def better_m(self) -> float:
        """A suitable range [m]."""
        return max(FIT_RATIO * self.usual_m, 0.1)


def find_range_fault(
    world: World, robot: Robot, controller: object, max_ratio: float = MAX_RATIO
) -> RangeFault | None:
    """Return the fault if the avoidance range exceeds ``max_ratio`` times the median free space."""
    avoidance = find_avoidance_range(controller)
    obstacles = join_areas(world, robot.height_m)
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
            f"leg {index + 1} of the course, {lengths[index]:.3g} m long, counts as complete from "
            f"the start, because acceptance_m is {course.acceptance_m:g} m; lower "
            "course.acceptance_m, or move the waypoints apart"
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
    """Return the distance (n,) [m] from each of the points (n, 2) to the nearest obstacle."""
    boxes = np.array([find_bounds(area) for area in obstacles])[:, :, None]
    outside = np.maximum(np.maximum(boxes[:, 0] - points, points - boxes[:, 1]), 0.0)
    gaps = np.sqrt((outside * outside).sum(axis=2))  # lower bounds of the distances
    free = np.full(len(points), np.inf)
    for i in np.argsort(gaps.min(axis=1)).tolist():
        if (gaps[i] < free).any():
            free = np.minimum(free, distances(obstacles[i], points))
    return free


def _check_passages(
    course: Course, obstacles: Sequence[Footprint], half_width: float, robot: str
) -> Iterator[str]:
    """Warn about waypoints that no path as wide as the robot reaches; rounding widens paths."""
    goals = np.array([course.home[:2], *course.waypoints])
    vertices = np.concatenate([goals, *(footprint.vertices for footprint in obstacles)])
    low, high = vertices.min(axis=0) - 2 * half_width - 1, vertices.max(axis=0) + 2 * half_width + 1
    cell = max(CELL_M, float((high - low).max()) / MAX_CELLS)
    radius = half_width - cell / math.sqrt(2)
    space = FreeSpace.within(low, high, obstacles, radius, cell_m=cell)
    rows = np.floor((goals - low) / cell).astype(int)[:, ::-1].tolist()
    home, reach = tuple(rows[0]), math.ceil(course.acceptance_m / cell)
    space.free[home] = True
    reached = find_connected(space.free, home)
    for point, (i, j) in zip(course.waypoints, rows[1:], strict=True):
        if not reached[max(0, i - reach) : i + reach + 1, max(0, j - reach) : j + reach + 1].any():
            yield (
                f"no path between the obstacles from home to the waypoint ({_point(point)}) is as "
                f"wide as {robot} ({2 * half_width:.3g} m); move the waypoint, or choose a "
                f"smaller robot"
            )


def _point(point: Sequence[float]) -> str:
    return f"{point[0]:g}, {point[1]:g}"


def check_home(subject: Subject) -> Iterator[str]:
    """Yield a warning for each body that is, or will be, in the way of the robot at home."""
    for name, world in subject.scenario.world.items():
        for message in check_place(world, subject.member.robot):
            yield f"world.{name} ({world.source}): {message}"


def check_place(world: World, robot: Robot) -> Iterator[str]:
    """Yield a warning for each body in the way of a robot at home in a world."""
    course, bodies = world.course, world.obstacles
    place = f"at home ({course.home_x_m:g}, {course.home_y_m:g})"
    touched = _list_touched(robot.outline, course, bodies, robot.height_m)
    if touched:
        named = ", ".join(map(_describe, touched))
        problem = f"{robot.name} touches an obstacle {place}: {named}; {_MOVE}"
        inner = robot.outline * (1.0 - _STANDING_IN)
        stands_in = _list_touched(inner, course, touched, robot.height_m)
        if (course.end_on_collision or stands_in) and world.sampler is None:
            raise InputError(f"{world.source}: {problem}")
        yield problem
    start = max(course.home_z_m, 0.0)
    for body in _list_touched(robot.outline, course, bodies, robot.height_m + start):
        if body not in touched:
            yield (
                f"{robot.name}, {robot.height_m:.3g} m high, starts {start:g} m above the ground "
                f"{place}, inside {_describe(body)}; lower course.home_z_m, or {_MOVE}"
            )
    for body in _list_falling(robot, world):
        yield f"{_describe(body)} falls on {robot.name} {place}; {_MOVE}, or make it <static>"


def _list_touched(
    outline: Array, course: Course, bodies: Sequence[Body], height: float
) -> list[Body]:
    x, y, _, yaw = course.home
    home = np.array([[x, y, yaw]])
    reach = float(np.abs(outline).max()) * math.sqrt(2)
    around = home[:, :2] + [[-reach], [reach]]

    def touches(some: Sequence[Body]) -> bool:
        areas = project_bodies(some, height, around)
        return bool(areas) and float(compute_clearances(outline, home, areas)[0]) <= 0.0

    return [body for body in bodies if touches([body])] if touches(bodies) else []


def _list_falling(robot: Robot, world: World) -> list[Body]:
    ground = [body for body in world.bodies if body.is_ground]
    falling: dict[str, Body] = {}
    landed = []
    for body, standing in zip(world.obstacles, standing_obstacles(world), strict=True):
        if body.mass is None:
            continue
        height = ground_height(ground, body.pose.position[:2]) or 0.0
        if body.pose.position[2] - height - standing.pose.position[2] > GAP_M:
            falling[body.name] = body
            landed.append(standing)
    hit = _list_touched(robot.outline, world.course, landed, robot.height_m)
    return [falling[body.name] for body in hit]


def _describe(body: Body) -> str:
    bottom = lowest_point(body)
    weight = "" if body.mass is None else f", {body.mass:g} kg"
    height = f", its underside at {bottom:.3g} m" if bottom > GAP_M else ""
    return f"{body.name!r}{weight}{height}"
