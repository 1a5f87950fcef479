"""How a robot pushes bodies in the plane, which ``planar_bodies`` describes.

The motion is quasi-static: bodies move only while they are pushed, without inertia. In each step,
the contacts push overlapping bodies apart, one after another, until no overlap is left.
"""

from typing import NamedTuple, TypeAlias

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.geometry import outlines
from evoros.geometry.contact import polygon_contact
from evoros.geometry.grid import cell_at
from evoros.simulator.engines import planar_bodies as bodies
from evoros.simulator.engines.planar_bodies import Movables, Placed, PlanarPose, place_body, pose_of
from evoros.simulator.engines.planar_friction import Push, move_body

UNTOUCHED, PUSHED, BLOCKED = range(3)
SWEEPS = 40  # over all contacts, after which bodies that still overlap are blocked
TOLERANCE_M = 1e-5  # of an overlap

Contact: TypeAlias = tuple[float, float, float, float, float, float]
"""The result of ``polygon_contact``."""


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
    """Push bodies off a robot's outline, or leave them: return UNTOUCHED, PUSHED or BLOCKED."""
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
    """Move the bodies back to where they were before the last push."""
    for i in range(len(placed.levels)):
        if placed.levels[i] > 0.0:
            for k in range(bodies.POSE_SIZE):
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
    """Return how far [m] the robot's point of contact, at ``side`` [m], moved beside the normal."""
    _, nx, ny, along, _, _ = contact
    x, y, cos, sin = robot.pose
    old_x, old_y, old_cos, old_sin = robot.before
    # The place of the point on the robot, and from there, its place in the world before.
    px = along * nx - side * ny - x
    py = along * ny + side * nx - y
    ahead = cos * px + sin * py
    aside = cos * py - sin * px
    dx = px + x - (old_x + old_cos * ahead - old_sin * aside)
    dy = py + y - (old_y + old_sin * ahead + old_cos * aside)
    return dy * nx - dx * ny


@compilable
def is_near(placed: Placed, index: int, x: float, y: float, distance: float) -> bool:
    """Whether a body is within a distance [m] of a place; not if that is NaN."""
    dx = placed.poses[index, bodies.BODY_X] - x
    dy = placed.poses[index, bodies.BODY_Y] - y
    return bool(dx * dx + dy * dy <= distance * distance)


@compilable
def middle_of(placed: Placed, index: int, contact: Contact) -> float:
    """Return the place of a contact beside its normal [m] that is nearest to a body's centre."""
    _, nx, ny, _, low, high = contact
    x, y, _, _ = pose_of(placed, index)
    return min(max(y * nx - x * ny, low), high)


class Wall(NamedTuple):
    """A rounded polygon off which a body is pushed."""

    corners: Array  # (k, 2) [m]
    radius: float  # [m]
    bottom: float  # [m]
    top: float  # [m]


@compilable
def push_off(movables: Movables, placed: Placed, index: int, wall: Wall) -> bool:
    """Push a body off a wall without friction; return whether it overlapped the wall."""
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
    """Push a body off the obstacles that stay; return whether it overlapped one."""
    radius = movables.bodies[index, bodies.BODY_RADIUS]
    pose = placed.poses[index]
    cell = cell_at(movables.grid, pose[bodies.BODY_X], pose[bodies.BODY_Y])
    if cell < 0:
        return False
    overlaps = False
    for entry in range(int(movables.starts[cell]), int(movables.starts[cell + 1])):
        row = movables.fixed[int(movables.entries[entry])]
        x, y, reach = row[outlines.CENTRE_X], row[outlines.CENTRE_Y], radius + row[outlines.CIRCLE]
        if is_near(placed, index, x, y, reach):
            corners = movables.fixed_corners[int(row[outlines.START]) : int(row[outlines.END])]
            bottom, top = row[bodies.FIXED_BOTTOM], row[bodies.FIXED_TOP]
            wall = Wall(corners, row[outlines.RADIUS], bottom, top)
            overlaps = push_off(movables, placed, index, wall) or overlaps
    return overlaps


@compilable
def push_by_body(movables: Movables, placed: Placed, index: int) -> bool:
    """Push others off a body that is nearer to the robot; return whether any overlap."""
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
    """Push another body off a body; return whether they overlapped."""
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
