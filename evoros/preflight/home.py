"""Finds the bodies that a robot touches at home, that it starts in, or that fall on it there."""

from collections.abc import Iterator, Sequence

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.geometry.clearance import compute_clearances
from evoros.geometry.footprint import bottom_height, project_bodies
from evoros.geometry.shapes import Body
from evoros.preflight.subject import Subject
from evoros.robot.model import Robot
from evoros.world.course import Course
from evoros.world.floors import ground_height
from evoros.world.model import World
from evoros.world.standing import GAP_M, standing_obstacles

STANDING_IN = 0.1
"""The share of the robot by which it may overlap an obstacle at home and still only touch it."""

MOVE = "move the body, or home (course.home_x_m, course.home_y_m)"


def check_home(subject: Subject) -> Iterator[str]:
    """Yield a warning for each body that is in the robot's way at home, or will be."""
    for name, world in subject.world.items():
        for message in check_place(world, subject.robot):
            yield f"world.{name} ({world.source}): {message}"


def check_place(world: World, robot: Robot) -> Iterator[str]:
    """Yield a warning for each body that is in the way of a robot at the home of a world.

    Raises:
        InputError: the robot stands in an obstacle at home, or it touches one and missions end on
            collision.
    """
    course, bodies = world.course, world.obstacles
    place = f"at home ({course.home_x_m:g}, {course.home_y_m:g})"
    touched = _list_touched(robot.outline, course, bodies, robot.height_m)
    if touched:
        named = ", ".join(map(_describe, touched))
        problem = f"{robot.name} touches an obstacle {place}: {named}; {MOVE}"
        inner = robot.outline * (1.0 - STANDING_IN)
        stands_in = _list_touched(inner, course, touched, robot.height_m)
        if (course.end_on_collision or stands_in) and world.sampler is None:
            raise InputError(f"{world.source}: {problem}")
        yield problem
    start = max(course.home_z_m, 0.0)
    for body in _list_touched(robot.outline, course, bodies, robot.height_m + start):
        if body not in touched:
            yield (
                f"{robot.name}, {robot.height_m:.3g} m high, starts {start:g} m above the ground "
                f"{place}, in {_describe(body)}; lower course.home_z_m, or {MOVE}"
            )
    for body in _list_falling(robot, world):
        yield f"{_describe(body)} falls on {robot.name} {place}; {MOVE}, or make it <static>"


def _list_touched(
    outline: Array, course: Course, bodies: Sequence[Body], height: float
) -> list[Body]:
    """List the bodies that an outline touches at home below a height [m]."""
    x, y, _, yaw = course.home
    home = np.array([[x, y, yaw]])

    def touches(some: Sequence[Body]) -> bool:
        areas = project_bodies(some, height)
        return bool(areas) and float(compute_clearances(outline, home, areas)[0]) <= 0.0

    return [body for body in bodies if touches([body])] if touches(bodies) else []


def _list_falling(robot: Robot, world: World) -> list[Body]:
    """List the bodies that fall to the robot's place at home."""
    ground = [body for body in world.bodies if body.is_ground]
    falling: dict[str, Body] = {}
    landed = []
    for body, standing in zip(world.obstacles, standing_obstacles(world), strict=True):
        height = ground_height(ground, body.pose.position[:2]) or 0.0
        if body.pose.position[2] - height - standing.pose.position[2] > GAP_M:
            falling[body.name] = body
            landed.append(standing)
    hit = _list_touched(robot.outline, world.course, landed, robot.height_m)
    return [falling[body.name] for body in hit]


def _describe(body: Body) -> str:
    bottom = min(bottom_height(shape, body.pose @ shape.pose) for shape in body.shapes)
    weight = "" if body.mass is None else f", {body.mass:g} kg"
    height = f", its underside at {bottom:.3g} m" if bottom > GAP_M else ""
    return f"{body.name!r}{weight}{height}"
