"""How a robot pushes bodies in the plane, which ``planar_bodies`` describes.

The motion is quasi-static: bodies move only while they are pushed, without inertia. In each step,
the contacts push overlapping bodies apart, one after another, until no overlap is left.
"""

from typing import NamedTuple, TypeAlias

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.geometry.contact import polygon_contact
from evoros.geometry.grid import cell_at
from evoros.geometry.outlines import CENTRE_X, CENTRE_Y, CIRCLE
from evoros.geometry.outlines import END as FIXED_END
from evoros.geometry.outlines import RADIUS as FIXED_RADIUS
from evoros.geometry.outlines import START as FIXED_START
from evoros.simulator.engines.planar_bodies import (
    BODY_RADIUS,
    BODY_X,
    BODY_Y,
    BOTTOM,
    END,
    END_PART,
    FIRST_PART,
    FIXED_BOTTOM,
    FIXED_TOP,
    FRICTION,
    LOAD,
    POSE_SIZE,
    RADIUS,
    START,
    TOP,
    Movables,
    Placed,
    PlanarPose,
    place_body,
    pose_of,
)
from evoros.simulator.engines.planar_friction import Push, move_body

UNTOUCHED, PUSHED, BLOCKED = range(3)
SWEEPS = 40  # over all contacts, after which bodies that still overlap are blocked
TOLERANCE_M = 1e-5  # of an overlap

Contact: TypeAlias = tuple[float, float, float, float, float, float]
"""As ``polygon_contact`` returns it."""


class Pusher(NamedTuple):
    """A robot that makes a step."""

    mass: float  # [kg]; it overcomes the friction of as much, with a coefficient of 1
    height: float  # [m]
    radius: float  # [m] of the outline about the robot's origin
    outline: Array  # (k, 2) [m], at the pose after the step
    pose: PlanarPose  # after the step
    before: PlanarPose


@compilable
def push_bodies(movables: Movables, placed: Placed, robot: Pusher) -> int:
    """Push the bodies that a robot's outline overlaps, or leave them if it cannot push so far.

    Returns:
        UNTOUCHED, PUSHED or BLOCKED.
    """
    levels = placed.levels
    for i in range(len(levels)):
        levels[i] = 0.0
        for k in range(POSE_SIZE):
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
            load += movables.bodies[i, LOAD]
    if left or load > robot.mass:
        put_back(movables, placed)
        return BLOCKED
    return PUSHED


@compilable
def put_back(movables: Movables, placed: Placed) -> None:
    """Move the bodies back to where they were before the last push."""
    for i in range(len(placed.levels)):
        if placed.levels[i] > 0.0:
            for k in range(POSE_SIZE):
                placed.poses[i, k] = placed.saved[i, k]
            place_body(movables, placed, i)


@compilable
def push_by_robot(movables: Movables, placed: Placed, robot: Pusher, slip: float) -> bool:
    """Push each body off the robot; return whether any overlapped it.

    ``slip`` tells whether to drag them along by friction; else the contact sticks where it is.
    """
    x, y, _, _ = robot.pose
    overlaps = False
    for i in range(len(placed.levels)):
        body = movables.bodies[i]
        if not is_near(placed, i, x, y, robot.radius + body[BODY_RADIUS]):
            continue
        for p in range(int(body[FIRST_PART]), int(body[END_PART])):
            part = movables.parts[p]
            if part[BOTTOM] >= robot.height or part[TOP] <= 0.0:
                continue
            polygon = placed.corners[int(part[START]) : int(part[END])]
            contact = polygon_contact(robot.outline, polygon, 0.0, part[RADIUS])
            depth, nx, ny, along, _, _ = contact
            if depth <= TOLERANCE_M:
                continue
            overlaps = True
            placed.levels[i] = 1.0
            side = middle_of(placed, i, contact)
            drag = slip * drag_along(robot, contact, side)
            push = Push(depth, nx, ny, along, side, drag, body[FRICTION])
            move_body(movables, placed, i, push)
    return overlaps


@compilable
def drag_along(robot: Pusher, contact: Contact, side: float) -> float:
    """Return how far [m] the robot's point of contact moved in the step, beside the normal.

    ``side`` [m] is its place beside the normal.
    """
    _, nx, ny, along, _, _ = contact
    x, y, cos, sin = robot.pose
    old_x, old_y, old_cos, old_sin = robot.before
    # Where the point is on the robot, and from there, where it was in the world.
    px = along * nx - side * ny - x
    py = along * ny + side * nx - y
    ahead = cos * px + sin * py
    aside = cos * py - sin * px
    dx = px + x - (old_x + old_cos * ahead - old_sin * aside)
    dy = py + y - (old_y + old_sin * ahead + old_cos * aside)
    return dy * nx - dx * ny


@compilable
def is_near(placed: Placed, number: int, x: float, y: float, distance: float) -> bool:
    """Whether a body is within a distance [m] of a place; not if that is NaN."""
    dx = placed.poses[number, BODY_X] - x
    dy = placed.poses[number, BODY_Y] - y
    return bool(dx * dx + dy * dy <= distance * distance)


@compilable
def middle_of(placed: Placed, number: int, contact: Contact) -> float:
    """Return the place of a contact beside its normal [m] that is nearest to a body's centre."""
    _, nx, ny, _, low, high = contact
    x, y, _, _ = pose_of(placed, number)
    return min(max(y * nx - x * ny, low), high)


@compilable
def push_off(movables: Movables, placed: Placed, number: int, contact: Contact) -> bool:
    """Push a body off an obstacle or another body without friction, if it overlaps that."""
    depth, nx, ny, along, _, _ = contact
    if depth <= TOLERANCE_M:
        return False
    push = Push(depth, nx, ny, along, middle_of(placed, number, contact), 0.0, 0.0)
    move_body(movables, placed, number, push)
    return True


@compilable
def push_by_fixed(movables: Movables, placed: Placed, number: int) -> bool:
    """Push a body off the obstacles that stay; return whether it overlapped one."""
    body = movables.bodies[number]
    cell = cell_at(movables.grid, placed.poses[number, BODY_X], placed.poses[number, BODY_Y])
    if cell < 0:
        return False
    overlaps = False
    for entry in range(int(movables.starts[cell]), int(movables.starts[cell + 1])):
        row = movables.fixed[int(movables.entries[entry])]
        reach = body[BODY_RADIUS] + row[CIRCLE]
        if not is_near(placed, number, row[CENTRE_X], row[CENTRE_Y], reach):
            continue
        wall = movables.fixed_corners[int(row[FIXED_START]) : int(row[FIXED_END])]
        for p in range(int(body[FIRST_PART]), int(body[END_PART])):
            part = movables.parts[p]
            if row[FIXED_TOP] <= part[BOTTOM] or part[TOP] <= row[FIXED_BOTTOM]:
                continue
            polygon = placed.corners[int(part[START]) : int(part[END])]
            contact = polygon_contact(wall, polygon, row[FIXED_RADIUS], part[RADIUS])
            overlaps = push_off(movables, placed, number, contact) or overlaps
    return overlaps


@compilable
def push_by_body(movables: Movables, placed: Placed, number: int) -> bool:
    """Push other bodies off a body; return whether any overlapped it.

    Of two bodies, the one that is nearer to the robot in the chain pushes the other.
    """
    levels = placed.levels
    overlaps = False
    for j in range(len(levels)):
        if j == number or 0.0 < levels[j] < levels[number]:
            continue
        if levels[j] == levels[number] and j < number:
            continue
        if push_body_by_body(movables, placed, number, j):
            overlaps = True
            if levels[j] == 0.0:
                levels[j] = levels[number] + 1.0
    return overlaps


@compilable
def push_body_by_body(movables: Movables, placed: Placed, number: int, other: int) -> bool:
    """Push another body off a body; return whether they overlapped."""
    first, second = movables.bodies[number], movables.bodies[other]
    x = placed.poses[number, BODY_X]
    y = placed.poses[number, BODY_Y]
    if not is_near(placed, other, x, y, first[BODY_RADIUS] + second[BODY_RADIUS]):
        return False
    overlaps = False
    for p in range(int(first[FIRST_PART]), int(first[END_PART])):
        one = movables.parts[p]
        polygon = placed.corners[int(one[START]) : int(one[END])]
        for q in range(int(second[FIRST_PART]), int(second[END_PART])):
            two = movables.parts[q]
            if one[TOP] <= two[BOTTOM] or two[TOP] <= one[BOTTOM]:
                continue
            corners = placed.corners[int(two[START]) : int(two[END])]
            contact = polygon_contact(polygon, corners, one[RADIUS], two[RADIUS])
            overlaps = push_off(movables, placed, other, contact) or overlaps
    return overlaps
