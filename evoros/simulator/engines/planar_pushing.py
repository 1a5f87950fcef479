"""Pushing of movable bodies by robots in the plane.

The motion is quasi-static, without inertia; overlapping bodies are pushed apart contact by contact.
Ground friction follows its limit surface (Goyal, Ruina and Papadopoulos, Wear 143, 1991),
approximated by an ellipsoid (Howe and Cutkosky, International Journal of Robotics Research 15,
1996). A force f at a distance r from the centre of friction displaces the body in proportion to f,
and rotates it in proportion to (r x f) / c^2, where c is the ratio of the maximum moment to the
maximum force. The contact sticks or slides by Coulomb's law (Lynch, Maekawa and Tanie, IROS 1992).
"""

import math
from typing import NamedTuple, TypeAlias

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.geometry.footprint import CENTRE_X, CENTRE_Y, CIRCLE, END, RADIUS, START
from evoros.geometry.grid import cell_at
from evoros.geometry.polygon import polygon_contact
from evoros.simulator.engines import planar_bodies as bodies
from evoros.simulator.engines.planar_bodies import Movables, Placed, PlanarPose, place_body, pose_of

MAX_TURN = 0.3  # [rad], maximum rotation of a body by one contact per sweep


class Push(NamedTuple):
    """A contact that pushes a body."""

    depth: float  # [m], required displacement along the normal
    nx: float  # normal
    ny: float
    along: float  # [m], position along the normal
    side: float  # [m], position along the left-hand perpendicular of the normal
    drag: float  # [m], displacement along the perpendicular if the contact sticks
    friction: float  # coefficient


@compilable
def move_body(movables: Movables, placed: Placed, index: int, push: Push) -> None:
    """Displace a body at a contact by a push, and rotate the body accordingly."""
    x, y, cos, sin = pose_of(placed, index)
    # moment arms of unit forces along the perpendicular and along the normal
    arm = push.along - (x * push.nx + y * push.ny)
    lever = -(push.side - (y * push.nx - x * push.ny))
    squared = max(movables.bodies[index, bodies.ARM_SQUARED], 1e-6)
    force, across = solve_contact(push, arm, lever, squared)
    turn = (lever * force + arm * across) / squared
    turn_sin, turn_cos = elementary.sin_cos(min(max(turn, -MAX_TURN), MAX_TURN))
    new_cos = cos * turn_cos - sin * turn_sin
    new_sin = sin * turn_cos + cos * turn_sin
    length = math.sqrt(new_cos * new_cos + new_sin * new_sin)
    pose = placed.poses[index]
    pose[bodies.BODY_X] = x + force * push.nx - across * push.ny
    pose[bodies.BODY_Y] = y + force * push.ny + across * push.nx
    pose[bodies.BODY_COS] = new_cos / length
    pose[bodies.BODY_SIN] = new_sin / length
    place_body(movables, placed, index)


@compilable
def solve_contact(push: Push, arm: float, lever: float, squared: float) -> tuple[float, float]:
    """Return the displacement [m] of a contact point along the normal and across it."""
    nn = 1.0 + lever * lever / squared
    nt = lever * arm / squared
    tt = 1.0 + arm * arm / squared
    whole = nn * tt - nt * nt
    force = (tt * push.depth - nt * push.drag) / whole
    across = (nn * push.drag - nt * push.depth) / whole
    if push.friction == 0.0:
        return push.depth / nn, 0.0
    if force <= 0.0 or abs(across) > push.friction * force:
        edge = push.friction if across > 0.0 else -push.friction
        share = nn + edge * nt
        if share < 0.1:  # the body is wedged
            edge = 0.0
            share = nn
        force = push.depth / share
        across = edge * force
    return force, across


UNTOUCHED, PUSHED, BLOCKED = range(3)
SWEEPS = 40  # maximum number of passes over all contacts; any overlap then left blocks the robot
TOLERANCE_M = 1e-5  # tolerated overlap [m]

Contact: TypeAlias = tuple[float, float, float, float, float, float]  # a ``polygon_contact``


class Pusher(NamedTuple):
    """A robot that pushes bodies during a step."""

    mass: float  # [kg], mass whose friction at a coefficient of 1 the robot can overcome
    height: float  # [m]
    radius: float  # [m], radius of the outline about the robot's origin
    outline: Array  # (k, 2) [m], corners at the pose after the step
    pose: PlanarPose  # after the step
    before: PlanarPose


@compilable
def push_bodies(movables: Movables, placed: Placed, robot: Pusher) -> int:
    """Push bodies out of an outline, or restore them; return UNTOUCHED, PUSHED or BLOCKED."""
    levels = placed.levels
    for i in range(len(levels)):
        levels[i] = 0.0
        for k in range(bodies.POSE_SIZE):
            placed.saved[i, k] = placed.poses[i, k]
    touched = False
    left = True
    for sweep in range(SWEEPS):
        slip = 1.0 if sweep == 0 else 0.0
        left = push_by_robot(movables, placed, robot, slip)
        touched = touched or left
        if not touched:
            return UNTOUCHED
        for i in range(len(levels)):
            if levels[i] > 0.0:
                left = push_by_fixed(movables, placed, i) or left
                left = push_by_body(movables, placed, i) or left
        if not left:
            break
    load = 0.0
    for i in range(len(levels)):
        if levels[i] > 0.0:
            load += movables.bodies[i, bodies.LOAD]
    if left or load > robot.mass:
        put_back(movables, placed)
        return BLOCKED
    return PUSHED


@compilable
def put_back(movables: Movables, placed: Placed) -> None:
    """Restore the poses that all bodies had before the last push."""
    for i in range(len(placed.levels)):
        if placed.levels[i] > 0.0:
            for k in range(bodies.POSE_SIZE):
                placed.poses[i, k] = placed.saved[i, k]
            place_body(movables, placed, i)


@compilable
def push_by_robot(movables: Movables, placed: Placed, robot: Pusher, slip: float) -> bool:
    """Push bodies out of a robot's outline (if ``slip`` is 1, also sideways); True on overlap."""
    x, y, _, _ = robot.pose
    overlaps = False
    for i in range(len(placed.levels)):
        body = movables.bodies[i]
        if not is_near(placed, i, x, y, robot.radius + body[bodies.BODY_RADIUS]):
            continue
        for p in range(int(body[bodies.FIRST_PART]), int(body[bodies.END_PART])):
            part = movables.parts[p]
            if part[bodies.BOTTOM] >= robot.height or part[bodies.TOP] <= 0.0:
                continue
            polygon = placed.corners[int(part[bodies.START]) : int(part[bodies.END])]
            contact = polygon_contact(robot.outline, polygon, 0.0, part[bodies.RADIUS])
            depth, nx, ny, along, _, _ = contact
            if depth <= TOLERANCE_M:
                continue
            overlaps = True
            placed.levels[i] = 1.0
            side = middle_of(placed, i, contact)
            drag = slip * drag_along(robot, contact, side)
            push = Push(depth, nx, ny, along, side, drag, body[bodies.FRICTION])
            move_body(movables, placed, i, push)
    return overlaps


@compilable
def drag_along(robot: Pusher, contact: Contact, side: float) -> float:
    """Return the robot's motion [m] across the contact normal at position ``side`` [m]."""
    _, nx, ny, along, _, _ = contact
    x, y, cos, sin = robot.pose
    old_x, old_y, old_cos, old_sin = robot.before
    # contact point relative to the robot, and the robot's displacement there
    px = along * nx - side * ny - x
    py = along * ny + side * nx - y
    ahead = cos * px + sin * py
    aside = cos * py - sin * px
    dx = px + x - (old_x + old_cos * ahead - old_sin * aside)
    dy = py + y - (old_y + old_sin * ahead + old_cos * aside)
    return dy * nx - dx * ny


@compilable
def is_near(placed: Placed, index: int, x: float, y: float, distance: float) -> bool:
    """Return True if a body is within a distance [m] of (x, y); False if this is NaN."""
    dx = placed.poses[index, bodies.BODY_X] - x
    dy = placed.poses[index, bodies.BODY_Y] - y
    return bool(dx * dx + dy * dy <= distance * distance)


@compilable
def middle_of(placed: Placed, index: int, contact: Contact) -> float:
    """Return the position [m] across the normal of the contact point nearest to the body."""
    _, nx, ny, _, low, high = contact
    x, y, _, _ = pose_of(placed, index)
    return min(max(y * nx - x * ny, low), high)


class Wall(NamedTuple):
    """A rounded polygon out of which bodies are pushed."""

    corners: Array  # (k, 2) [m]
    radius: float  # [m]
    bottom: float  # [m]
    top: float  # [m]


@compilable
def push_off(movables: Movables, placed: Placed, index: int, wall: Wall) -> bool:
    """Push a body out of a wall without friction; return True if the two overlapped."""
    body = movables.bodies[index]
    overlaps = False
    for p in range(int(body[bodies.FIRST_PART]), int(body[bodies.END_PART])):
        part = movables.parts[p]
        if wall.top <= part[bodies.BOTTOM] or part[bodies.TOP] <= wall.bottom:
            continue
        polygon = placed.corners[int(part[bodies.START]) : int(part[bodies.END])]
        contact = polygon_contact(wall.corners, polygon, wall.radius, part[bodies.RADIUS])
        depth, nx, ny, along, _, _ = contact
        if depth > TOLERANCE_M:
            side = middle_of(placed, index, contact)
            move_body(movables, placed, index, Push(depth, nx, ny, along, side, 0.0, 0.0))
            overlaps = True
    return overlaps


@compilable
def push_by_fixed(movables: Movables, placed: Placed, index: int) -> bool:
    """Push a body out of fixed obstacles; return True if it overlapped any."""
    radius = movables.bodies[index, bodies.BODY_RADIUS]
    pose = placed.poses[index]
    cell = cell_at(movables.grid, pose[bodies.BODY_X], pose[bodies.BODY_Y])
    if cell < 0:
        return False
    overlaps = False
    for entry in range(int(movables.starts[cell]), int(movables.starts[cell + 1])):
        row = movables.fixed[int(movables.entries[entry])]
        x, y, reach = row[CENTRE_X], row[CENTRE_Y], radius + row[CIRCLE]
        if is_near(placed, index, x, y, reach):
            corners = movables.fixed_corners[int(row[START]) : int(row[END])]
            bottom, top = row[bodies.FIXED_BOTTOM], row[bodies.FIXED_TOP]
            wall = Wall(corners, row[RADIUS], bottom, top)
            overlaps = push_off(movables, placed, index, wall) or overlaps
    return overlaps


@compilable
def push_by_body(movables: Movables, placed: Placed, index: int) -> bool:
    """Push bodies farther from the robot out of this body; return True if any overlapped."""
    levels = placed.levels
    overlaps = False
    for j in range(len(levels)):
        if j == index or 0.0 < levels[j] < levels[index]:
            continue
        if levels[j] == levels[index] and j < index:
            continue
        if push_body_by_body(movables, placed, index, j):
            overlaps = True
            if levels[j] == 0.0:
                levels[j] = levels[index] + 1.0
    return overlaps


@compilable
def push_body_by_body(movables: Movables, placed: Placed, index: int, other: int) -> bool:
    """Push another body out of this body; return True if the two overlapped."""
    body, pose = movables.bodies[index], placed.poses[index]
    reach = body[bodies.BODY_RADIUS] + movables.bodies[other, bodies.BODY_RADIUS]
    if not is_near(placed, other, pose[bodies.BODY_X], pose[bodies.BODY_Y], reach):
        return False
    overlaps = False
    for p in range(int(body[bodies.FIRST_PART]), int(body[bodies.END_PART])):
        part = movables.parts[p]
        corners = placed.corners[int(part[bodies.START]) : int(part[bodies.END])]
        wall = Wall(corners, part[bodies.RADIUS], part[bodies.BOTTOM], part[bodies.TOP])
        overlaps = push_off(movables, placed, other, wall) or overlaps
    return overlaps
