"""Finds waypoints outside the walls of a world, and sensors that look over all obstacles."""

import math
from collections.abc import Iterator

import numpy as np

from evoros.base.arrays import Array
from evoros.base.linear import product
from evoros.evolution.experiment import Experiment
from evoros.geometry.footprint import find_bounds, project_bodies, top_height
from evoros.preflight.subject import Subject, choose_middle
from evoros.robot.model import Robot
from evoros.sensor.protocol import sees
from evoros.world.model import World

MARGIN_M = 1.0
"""A waypoint may lie this far outside the box around the obstacles."""
SAMPLES = 100
WALLED_SHARE = 0.9
"""Share of the points on each side that obstacles must cover; the rest are doors."""


def check_waypoints(experiment: Experiment) -> Iterator[str]:
    """Yield a warning for each waypoint far outside the walls that surround home."""
    for key, member in ((member.key, member) for member in experiment.members):
        for name, world in experiment.scenario.place_worlds(member).items():
            outside = list(_list_outside(world))
            if outside:
                points = ", ".join(f"({x:g}, {y:g})" for x, y in outside)
                yield (
                    f"{key}world.{name}.course.waypoints: {points} more than {MARGIN_M:g} m "
                    f"outside the walls, which surround home; correct the waypoints, which "
                    f"are in metres"
                )


def _list_outside(world: World) -> Iterator[tuple[float, float]]:
    """Yield the waypoints outside the box that fixed obstacles line, if home is inside it."""
    areas = project_bodies([body for body in world.obstacles if body.mass is None])
    if not areas:
        return
    low, high = find_bounds(*areas)
    if not _encloses(np.array([find_bounds(area) for area in areas]), low, high):
        return
    course = world.course
    home = np.array([course.home_x_m, course.home_y_m])
    if not ((low <= home) & (home <= high)).all():
        return
    for x, y in course.waypoints:
        point = np.array([x, y])
        if ((point < low - MARGIN_M) | (point > high + MARGIN_M)).any():
            yield x, y


def _encloses(boxes: Array, low: Array, high: Array) -> bool:
    """Whether boxes (n, 2, 2) [m] line all four sides of the box around them, like walls."""
    for axis in (0, 1):
        along = np.linspace(low[1 - axis], high[1 - axis], SAMPLES)[:, None]
        covers = (boxes[:, 0, 1 - axis] <= along) & (along <= boxes[:, 1, 1 - axis])
        near_low = boxes[:, 0, axis] <= low[axis] + MARGIN_M
        near_high = boxes[:, 1, axis] >= high[axis] - MARGIN_M
        for side in (near_low, near_high):
            if covers[:, side].any(axis=1).mean() < WALLED_SHARE:
                return False
    return True


def check_view(subject: Subject) -> Iterator[str]:
    """Yield a warning for each type of sensor whose view stays above every obstacle.

    The ground is taken for level, and worlds that are drawn for each mission are left out.
    """
    worlds = list(subject.world.values())
    if any(world.sampler is not None or not world.is_level for world in worlds):
        return
    tops = [
        top_height(shape, body.pose @ shape.pose)
        for world in worlds
        for body in world.obstacles
        for shape in body.shapes
        if shape.kind != "plane"
    ]
    if not tops:
        return
    for member in subject.scenario.equip(choose_middle(subject.space)):
        for sensor, height in _list_upward(member.robot).items():
            if height > max(tops):
                yield (
                    f"design.sensors.{sensor}: looks over all obstacles, from {height:.3g} m "
                    f"above the ground; the tallest is {max(tops):.3g} m high; lower "
                    f"robot.mount.z_m or robot.mount.pitch_deg"
                )


def _list_upward(robot: Robot) -> dict[str, float]:
    """Return the lowest height [m] of the sensors of each type of which no ray points down."""
    heights: dict[str, float] = {}
    for mount, frame in zip(robot.mounts, robot.sensor_frames, strict=True):
        sensor = robot.sensors[mount.sensor]
        if sees(sensor):
            lowest = float(product(sensor.rays(), frame[:3, :3].T)[:, 2].min())
            # A ray that points up is lowest at the sensor.
            height = float(frame[2, 3]) if lowest >= 0.0 else -math.inf
            heights[mount.sensor] = min(height, heights.get(mount.sensor, math.inf))
    return heights
