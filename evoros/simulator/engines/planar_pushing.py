"""How a robot pushes bodies in the plane, over the arrays that ``planar_bodies`` describes.

The motion is quasi-static: bodies move only while they are pushed, without inertia. In each step,
the contacts push overlapping bodies apart, one after another, until no overlap is left.
"""

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.geometry.contact import polygon_contact
from evoros.geometry.grid import cell_at
from evoros.simulator.engines import planar_bodies as layout
from evoros.simulator.engines.planar_bodies import memory_views, part_of, place_body
from evoros.simulator.engines.planar_friction import move_body

UNTOUCHED, PUSHED, BLOCKED = range(3)
SWEEPS = 40  # over all contacts, after which bodies that still overlap are blocked
TOLERANCE_M = 1e-5  # of an overlap


@compilable
def push_bodies(
    pushing: Array,
    memory: Array,
    grid: Array,
    outline: Array,
    reach: float,
    pose: tuple[float, float, float, float],
    before: tuple[float, float, float, float],
) -> int:
    """Push the bodies that the robot's ``outline``, which is placed at ``pose``, overlaps.

    ``reach`` [m] is the radius of the outline about the robot's origin. ``pose`` and the one before
    the step are x, y [m] and the cosine and sine of the heading. The bodies stay where they are if
    the robot cannot push them so far.

    Returns:
        UNTOUCHED, PUSHED or BLOCKED.
    """
    poses, saved, levels, _, _ = memory_views(pushing, memory)
    for i in range(len(levels)):
        levels[i] = 0.0
        for k in range(layout.POSE_SIZE):
            saved[i, k] = poses[i, k]
    touched = False
    left = True
    for sweep in range(SWEEPS):
        slip = 1.0 if sweep == 0 else 0.0
        left = push_by_robot(pushing, memory, outline, reach, pose, before, slip)
        touched = touched or left
        if not touched:
            return UNTOUCHED
        for i in range(len(levels)):
            if levels[i] > 0.0:
                left = push_by_fixed(pushing, memory, grid, i) or left
                left = push_by_body(pushing, memory, i) or left
        if not left:
            break
    load = 0.0
    bodies = part_of(pushing, layout.BODIES).reshape((-1, layout.BODY_SIZE))
    for i in range(len(levels)):
        if levels[i] > 0.0:
            load += bodies[i, layout.LOAD]
    if left or load > pushing[layout.GRIP]:
        put_back(pushing, memory)
        return BLOCKED
    return PUSHED


@compilable
def put_back(pushing: Array, memory: Array) -> None:
    """Move the bodies back to where they were before the last push."""
    poses, saved, levels, _, _ = memory_views(pushing, memory)
    for i in range(len(levels)):
        if levels[i] > 0.0:
            for k in range(layout.POSE_SIZE):
                poses[i, k] = saved[i, k]
            place_body(pushing, memory, i)


@compilable
def push_by_robot(
    pushing: Array,
    memory: Array,
    outline: Array,
    reach: float,
    pose: tuple[float, float, float, float],
    before: tuple[float, float, float, float],
    slip: float,
) -> bool:
    """Push each body off the robot; return whether any overlapped it.

    ``slip`` tells whether to drag them along by friction; else the contact sticks where it is.
    """
    poses, _, levels, corners, _ = memory_views(pushing, memory)
    bodies = part_of(pushing, layout.BODIES).reshape((-1, layout.BODY_SIZE))
    parts = part_of(pushing, layout.PARTS).reshape((-1, layout.PART_SIZE))
    x, y, cos, sin = pose
    found = False
    for i in range(len(levels)):
        dx = poses[i, layout.BODY_X] - x
        dy = poses[i, layout.BODY_Y] - y
        near = reach + bodies[i, layout.BODY_RADIUS]
        if not dx * dx + dy * dy <= near * near:  # nor if the robot's place is NaN
            continue
        for p in range(int(bodies[i, layout.FIRST_PART]), int(bodies[i, layout.END_PART])):
            part = parts[p]
            if part[layout.BOTTOM] >= pushing[layout.HEIGHT] or part[layout.TOP] <= 0.0:
                continue
            polygon = corners[int(part[layout.START]) : int(part[layout.END])]
            contact = polygon_contact(outline, polygon, 0.0, part[layout.RADIUS])
            depth, nx, ny, along, low, high = contact
            if depth <= TOLERANCE_M:
                continue
            found = True
            levels[i] = 1.0
            side = poses[i, layout.BODY_Y] * nx - poses[i, layout.BODY_X] * ny
            side = min(max(side, low), high)
            # Where the robot's point of contact was before the step, in the world.
            px = along * nx - side * ny - x
            py = along * ny + side * nx - y
            ahead = cos * px + sin * py
            aside = cos * py - sin * px
            dx = px + x - (before[0] + before[2] * ahead - before[3] * aside)
            dy = py + y - (before[1] + before[3] * ahead + before[2] * aside)
            drag = slip * (dy * nx - dx * ny)
            friction = bodies[i, layout.FRICTION]
            move_body(pushing, memory, i, depth, nx, ny, along, side, drag, friction)
    return found


@compilable
def push_by_fixed(pushing: Array, memory: Array, grid: Array, number: int) -> bool:
    """Push a body off the obstacles that stay, without friction; return whether it overlapped."""
    poses, _, _, corners, _ = memory_views(pushing, memory)
    body = part_of(pushing, layout.BODIES).reshape((-1, layout.BODY_SIZE))[number]
    parts = part_of(pushing, layout.PARTS).reshape((-1, layout.PART_SIZE))
    fixed = part_of(pushing, layout.FIXED).reshape((-1, layout.FIXED_SIZE))
    fixed_corners = part_of(pushing, layout.FIXED_CORNERS).reshape((-1, 2))
    starts = part_of(pushing, layout.NEAR_STARTS)
    entries = part_of(pushing, layout.NEAR_ENTRIES)
    cell = cell_at(grid, poses[number, layout.BODY_X], poses[number, layout.BODY_Y])
    if cell < 0:
        return False
    found = False
    for entry in range(int(starts[cell]), int(starts[cell + 1])):
        row = fixed[int(entries[entry])]
        dx = row[layout.CENTRE_X] - poses[number, layout.BODY_X]
        dy = row[layout.CENTRE_Y] - poses[number, layout.BODY_Y]
        near = body[layout.BODY_RADIUS] + row[layout.CIRCLE]
        if dx * dx + dy * dy > near * near:
            continue
        wall = fixed_corners[int(row[layout.FIXED_START]) : int(row[layout.FIXED_END])]
        for p in range(int(body[layout.FIRST_PART]), int(body[layout.END_PART])):
            part = parts[p]
            if row[layout.FIXED_TOP] <= part[layout.BOTTOM]:
                continue
            if part[layout.TOP] <= row[layout.FIXED_BOTTOM]:
                continue
            polygon = corners[int(part[layout.START]) : int(part[layout.END])]
            contact = polygon_contact(wall, polygon, row[layout.FIXED_RADIUS], part[layout.RADIUS])
            depth, nx, ny, along, low, high = contact
            if depth > TOLERANCE_M:
                found = True
                side = poses[number, layout.BODY_Y] * nx - poses[number, layout.BODY_X] * ny
                side = min(max(side, low), high)
                move_body(pushing, memory, number, depth, nx, ny, along, side, 0.0, 0.0)
    return found


@compilable
def push_by_body(pushing: Array, memory: Array, number: int) -> bool:
    """Push other bodies off a body, without friction; return whether any overlapped it.

    Of two bodies, the one that is nearer to the robot in the chain pushes the other.
    """
    poses, _, levels, corners, _ = memory_views(pushing, memory)
    bodies = part_of(pushing, layout.BODIES).reshape((-1, layout.BODY_SIZE))
    parts = part_of(pushing, layout.PARTS).reshape((-1, layout.PART_SIZE))
    body = bodies[number]
    found = False
    for j in range(len(levels)):
        if j == number or 0.0 < levels[j] < levels[number]:
            continue
        if levels[j] == levels[number] and j < number:
            continue
        dx = poses[j, layout.BODY_X] - poses[number, layout.BODY_X]
        dy = poses[j, layout.BODY_Y] - poses[number, layout.BODY_Y]
        near = body[layout.BODY_RADIUS] + bodies[j, layout.BODY_RADIUS]
        if dx * dx + dy * dy > near * near:
            continue
        for p in range(int(body[layout.FIRST_PART]), int(body[layout.END_PART])):
            first = corners[int(parts[p, layout.START]) : int(parts[p, layout.END])]
            for q in range(int(bodies[j, layout.FIRST_PART]), int(bodies[j, layout.END_PART])):
                if parts[p, layout.TOP] <= parts[q, layout.BOTTOM]:
                    continue
                if parts[q, layout.TOP] <= parts[p, layout.BOTTOM]:
                    continue
                second = corners[int(parts[q, layout.START]) : int(parts[q, layout.END])]
                contact = polygon_contact(
                    first, second, parts[p, layout.RADIUS], parts[q, layout.RADIUS]
                )
                depth, nx, ny, along, low, high = contact
                if depth > TOLERANCE_M:
                    found = True
                    if levels[j] == 0.0:
                        levels[j] = levels[number] + 1.0
                    side = poses[j, layout.BODY_Y] * nx - poses[j, layout.BODY_X] * ny
                    side = min(max(side, low), high)
                    move_body(pushing, memory, j, depth, nx, ny, along, side, 0.0, 0.0)
    return found
