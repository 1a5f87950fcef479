"""Walkers in the plane: their motion in a step, and contacts with robots."""

import numpy as np

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.base.packing import unpack
from evoros.geometry import ray
from evoros.geometry.polygon import find_border
from evoros.geometry.shapes import Pose, Shape
from evoros.simulator.engines import planar_contact as contact
from evoros.simulator.engines.planar_bodies import Movables, Placed, PlanarPose
from evoros.simulator.engines.planar_layout import Memory, Plane, hull_of, pose_of
from evoros.simulator.engines.planar_pushing import BLOCKED, PUSHED, UNTOUCHED
from evoros.walkers import layout as at
from evoros.walkers.crowd import Crowd, note_touch
from evoros.walkers.layout import Walk, Walking
from evoros.walkers.motion import walk
from evoros.world.standing import sight_rows

NEAR_M = 1.0
"""Upper bound [m] of a robot's motion in a step."""


def place_crowd(placed: Placed, crowd: Crowd, robots: int) -> Placed:
    """Add the walkers of a mission to the bodies, at their initial places."""
    solids = [
        (Shape("cylinder", (radius, height)), Pose((0.0, 0.0, height / 2.0)))
        for radius, height in crowd.sizes
    ]
    rows = sight_rows(solids)[0]
    place_walkers(unpack(Walking, crowd.memory), rows)
    sights = np.concatenate([placed.sights, rows])
    return placed._replace(sights=sights, robots=np.zeros((robots, 4)), walking=crowd.memory.copy())


@compilable
def place_walkers(now: Walking, shapes: Array) -> None:
    """Move the ray shapes of the walkers, the last ones of ``shapes``, to their places."""
    first = len(shapes) - len(now.places)
    for i in range(len(now.places)):
        shapes[first + i, ray.AT_X] = now.places[i, 0]
        shapes[first + i, ray.AT_Y] = now.places[i, 1]


@compilable
def move_walkers(parameters: Array, memory: Array) -> None:
    """Move all walkers by a step, given the robots' present poses."""
    plane = unpack(Plane, parameters)
    placed = unpack(Placed, unpack(Memory, memory).movables)
    for i in range(len(placed.robots)):
        x, y, cos, sin = pose_of(memory, i)
        placed.robots[i, 0] = x
        placed.robots[i, 1] = y
        placed.robots[i, 2] = cos
        placed.robots[i, 3] = sin
    rule = unpack(Movables, plane.movables).walk
    walk(rule, placed.walking, placed.robots, plane.time_step)
    place_walkers(unpack(Walking, placed.walking), placed.sights)


@compilable
def meet_walkers(parameters: Array, memory: Array, index: int, pose: PlanarPose) -> int:
    """Return if walkers leave a robot UNTOUCHED, PUSHED or BLOCKED at a pose, and note the touches.

    A robot does not drive deeper into a walker that it overlaps.
    """
    movables = unpack(Movables, unpack(Plane, parameters).movables)
    placed = unpack(Placed, unpack(Memory, memory).movables)
    walkers, walking = unpack(Walk, movables.walk).walkers, unpack(Walking, placed.walking)
    hull, here = hull_of(parameters, index), pose_of(memory, index)
    result = UNTOUCHED
    for i in range(len(walkers)):
        radius = walkers[i, at.RADIUS]
        x = walking.places[i, 0]
        y = walking.places[i, 1]
        near = hull.radius + radius + NEAR_M
        if (x - pose[0]) * (x - pose[0]) + (y - pose[1]) * (y - pose[1]) > near * near:
            continue
        before = measure_gap(hull.outline, here, x, y)
        after = measure_gap(hull.outline, pose, x, y)
        if min(before, after) >= radius:
            continue
        note_touch(walking, i, index)
        contact.place_outline(parameters, memory, index, pose)
        centre = walking.places[i : i + 1]
        contact.feel_polygon(parameters, memory, index, pose, centre, radius + contact.SKIN_M)
        if after < radius and after < before:
            result = BLOCKED
        elif result == UNTOUCHED:
            result = PUSHED
    return result


@compilable
def measure_gap(outline: Array, pose: PlanarPose, x: float, y: float) -> float:
    """Return the distance [m] of a place from an outline at a pose, negative inside."""
    px, py, cos, sin = pose
    dx = x - px
    dy = y - py
    gap, _, _ = find_border(outline, cos * dx + sin * dy, cos * dy - sin * dx)
    return gap
