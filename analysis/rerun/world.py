"""The world of a mission in a recording: ground, obstacles and course."""

import math
from collections.abc import Sequence

import numpy as np
import rerun as rr

from evoros.base.arrays import Array
from evoros.geometry.shapes import Body
from evoros.world.standing import standing_obstacles

from ..bags.missions import RecordedMission
from ..video.renderer import FIXED, MOVABLE
from ..video.surfaces import Colour, Surface
from .entities import Entities, to_mesh

GROUND, COURSE = (0.93, 0.92, 0.9), (200, 120, 0)
_AROUND_M = 4.0  # width of the ground around course and path
_BELOW_M = 0.002  # so that nothing on the ground flickers


def show_world(top: Entities, mission: RecordedMission) -> None:
    """Show the ground around a mission, and what stands on it."""
    places = mission.trajectory[["x_m", "y_m"]].to_numpy(float)
    points = np.vstack([places, mission.route, [mission.world.course.home[:2]]])
    low, high = points.min(axis=0) - _AROUND_M, points.max(axis=0) + _AROUND_M
    corners = np.array(
        [[x, y, -_BELOW_M] for x, y in (low, (high[0], low[1]), high, (low[0], high[1]))]
    )
    triangles = corners[[[0, 1, 2], [0, 2, 3]]]
    ground = Surface.from_triangles(triangles, np.tile(GROUND, (2, 1)))
    top.below("ground").show(to_mesh(ground))
    bodies = standing_obstacles(mission.world)
    for name, colour, movable in (("fixed", FIXED, False), ("movable", MOVABLE, True)):
        shown = [body for body in bodies if (body.mass is not None) == movable]
        surface = _join(shown, colour)
        if len(surface.normals):
            top.below(name).show(to_mesh(surface))


def _join(bodies: Sequence[Body], colour: Colour) -> Surface:
    triangles = [np.empty((0, 3, 3))]
    for body in bodies:
        surface = Surface.from_shapes(body.shapes, [colour] * len(body.shapes))
        triangles.append(surface.triangles @ body.pose.rotation.T + body.pose.position)
    joined = np.concatenate(triangles)
    return Surface.from_triangles(joined, np.tile(colour, (len(joined), 1)))


def show_course(top: Entities, mission: RecordedMission) -> None:
    """Show the route of a robot, with its waypoints and the circles in which they count."""
    course = mission.world.course
    goals = [[x, y, 0.0] for x, y in mission.route.tolist()]
    home = [*course.home[:2], 0.0]
    top.below("route").show(rr.LineStrips3D([[home, *goals]], colors=COURSE, radii=0.008))
    distinct = course.route(True)[: len(course.waypoints) + 1]
    circles = [_circle(x, y, course.acceptance_m) for x, y in distinct.tolist()]
    labels = [*(str(i + 1) for i in range(len(course.waypoints))), "home"]
    top.below("acceptance").show(rr.LineStrips3D(circles, colors=COURSE, radii=0.008))
    places = [[x, y, 0.0] for x, y in distinct.tolist()]
    points = rr.Points3D(places, colors=COURSE, radii=0.04, labels=labels)
    top.below("waypoints").show(points)


def _circle(x: float, y: float, radius: float) -> Array:
    angles = np.linspace(0.0, 2 * math.pi, 49)
    return np.stack(
        [x + radius * np.cos(angles), y + radius * np.sin(angles), 0.0 * angles], axis=1
    )
