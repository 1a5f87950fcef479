"""The rules of motion of the planar simulator, over the arrays that ``planar_layout`` describes.

They give the same bits compiled and interpreted.
"""

import math

from evoros.base import elementary
from evoros.base.arrays import (
    CONTACT,
    DRIVE_SPEED,
    SPEED,
    STATE_SIZE,
    STEERING,
    YAW,
    YAW_RATE,
    Array,
    X,
    Y,
)
from evoros.base.compilable import compilable
from evoros.geometry.grid import cell_at
from evoros.geometry.outlines import (
    CENTRE_X,
    CENTRE_Y,
    CIRCLE,
    END,
    FOOTPRINT_SIZE,
    RADIUS,
    START,
)
from evoros.geometry.polygon import polygon_distance, transform_polygon
from evoros.simulator.engines import planar_layout as layout
from evoros.simulator.engines.planar_layout import block
from evoros.simulator.engines.planar_pushing import BLOCKED, UNTOUCHED, push_bodies
from evoros.simulator.engines.planar_sensing import moving_memory
from evoros.simulator.engines.planar_signals import feel

FULL_TURN = 2.0 * math.pi


@compilable
def observe(parameters: Array, memory: Array, state: Array) -> None:
    """Copy the state and clear its contact, which is that since the last call."""
    for i in range(STATE_SIZE):
        state[i] = memory[i]
    memory[CONTACT] = 0.0


def advance(parameters: Array, memory: Array, command: Array, duration: float) -> None:
    """Drive for ``duration`` [s]; a step into an obstacle is not made, and the robot stops."""
    sin, cos = elementary.sin_cos(memory[YAW])
    for _ in range(round(duration / parameters[layout.TIME_STEP])):
        pose = predict(parameters, memory, command, cos, sin)
        if touches(parameters, memory, pose[0], pose[1], pose[3], pose[4]):
            memory[CONTACT] = 1.0
            stop(memory)
            continue
        cos, sin = move(parameters, memory, pose)


def advance_pushing(parameters: Array, memory: Array, command: Array, duration: float) -> None:
    """Drive as ``advance`` does, among bodies that can be pushed.

    They are no obstacles as long as they can, by ``planar_pushing``.
    """
    sin, cos = elementary.sin_cos(memory[YAW])
    for _ in range(round(duration / parameters[layout.TIME_STEP])):
        pose = predict(parameters, memory, command, cos, sin)
        x, y, _, new_cos, new_sin = pose
        if touches(parameters, memory, x, y, new_cos, new_sin):
            contact = BLOCKED
        else:
            contact = push(parameters, memory, (x, y, new_cos, new_sin), cos, sin)
        if contact != UNTOUCHED:
            memory[CONTACT] = 1.0
        if contact == BLOCKED:
            stop(memory)
            continue
        cos, sin = move(parameters, memory, pose)


def advance_feeling(parameters: Array, memory: Array, command: Array, duration: float) -> None:
    """Drive as ``advance`` or ``advance_pushing``, and count what contact sensors feel."""
    sin, cos = elementary.sin_cos(memory[YAW])
    pushes = len(block(parameters, layout.PUSHING)) > 0
    for _ in range(round(duration / parameters[layout.TIME_STEP])):
        pose = predict(parameters, memory, command, cos, sin)
        x, y, _, new_cos, new_sin = pose
        contact = UNTOUCHED
        if touches(parameters, memory, x, y, new_cos, new_sin):
            contact = BLOCKED
        elif pushes:
            contact = push(parameters, memory, (x, y, new_cos, new_sin), cos, sin)
        if contact != UNTOUCHED:
            memory[CONTACT] = 1.0
            outline = place_outline(parameters, memory, x, y, new_cos, new_sin)
            feel(parameters, memory, outline, x, y, new_cos, new_sin)
        if contact == BLOCKED:
            stop(memory)
            continue
        cos, sin = move(parameters, memory, pose)


@compilable
def predict(
    parameters: Array, memory: Array, command: Array, cos: float, sin: float
) -> tuple[float, float, float, float, float]:
    """Return where the robot is after a step: x, y [m], yaw [rad], and its cosine and sine.

    ``cos`` and ``sin`` are those of its yaw before. The servos have moved on.
    """
    axle = parameters[layout.REAR_AXLE_X]
    limit = parameters[layout.STEERING_LIMIT]
    step = parameters[layout.TIME_STEP]
    wanted = min(max(command[STEERING], -limit), limit)
    yaw = memory[YAW]
    angle = layout.STEERING_ANGLE
    memory[angle] += parameters[layout.STEERING_GAIN] * (wanted - memory[angle])
    curvature = elementary.tan(memory[angle]) / parameters[layout.WHEELBASE]
    offset = parameters[layout.SPEED_LIMIT_OFFSET]
    fastest = parameters[layout.MAX_SPEED] / (1.0 + abs(curvature) * offset)
    target = min(max(command[DRIVE_SPEED], -fastest), fastest)
    memory[SPEED] += parameters[layout.SPEED_GAIN] * (target - memory[SPEED])
    memory[YAW_RATE] = memory[SPEED] * curvature
    # The rear axle moves along an arc, whose chord points half the turn to the side.
    half = 0.5 * memory[YAW_RATE] * step
    chord = memory[SPEED] * step
    half_sin, half_cos = elementary.sin_cos(half)
    if abs(half) > 1e-6:
        chord = chord * half_sin / half
    x = memory[X] + axle * cos + chord * (cos * half_cos - sin * half_sin)
    y = memory[Y] + axle * sin + chord * (sin * half_cos + cos * half_sin)
    new_yaw = yaw + 2.0 * half
    if new_yaw > math.pi:
        new_yaw -= FULL_TURN
    elif new_yaw < -math.pi:
        new_yaw += FULL_TURN
    new_sin, new_cos = elementary.sin_cos(new_yaw)
    return x - axle * new_cos, y - axle * new_sin, new_yaw, new_cos, new_sin


@compilable
def stop(memory: Array) -> None:
    """Stop where the robot is."""
    memory[SPEED] = 0.0
    memory[YAW_RATE] = 0.0


@compilable
def move(
    parameters: Array, memory: Array, pose: tuple[float, float, float, float, float]
) -> tuple[float, float]:
    """Move the robot to a pose of ``predict``; return cosine and sine of its yaw."""
    memory[layout.ROLLED] += memory[SPEED] * parameters[layout.TIME_STEP]
    memory[layout.TURNED] += memory[YAW_RATE] * parameters[layout.TIME_STEP]
    memory[X] = pose[0]
    memory[Y] = pose[1]
    memory[YAW] = pose[2]
    return pose[3], pose[4]


@compilable
def push(
    parameters: Array,
    memory: Array,
    pose: tuple[float, float, float, float],
    cos: float,
    sin: float,
) -> int:
    """Push the bodies in the robot's way to a pose from where it is; see ``push_bodies``.

    ``cos`` and ``sin`` are those of its heading before.
    """
    return push_bodies(
        block(parameters, layout.PUSHING),
        memory[moving_memory(parameters) :],
        block(parameters, layout.GRID),
        place_outline(parameters, memory, pose[0], pose[1], pose[2], pose[3]),
        parameters[layout.OUTLINE_RADIUS],
        pose,
        (memory[X], memory[Y], cos, sin),
    )


@compilable
def placed_outline(parameters: Array, memory: Array) -> Array:
    """Return the outline of the robot where it was placed last, in the memory."""
    end = layout.PLACED_OUTLINE + len(block(parameters, layout.OUTLINE))
    return memory[layout.PLACED_OUTLINE : end].reshape((-1, 2))


@compilable
def place_outline(
    parameters: Array, memory: Array, x: float, y: float, cos: float, sin: float
) -> Array:
    """Return the outline of the robot at x, y [m], in the memory."""
    placed = placed_outline(parameters, memory)
    transform_polygon(block(parameters, layout.OUTLINE).reshape((-1, 2)), x, y, cos, sin, placed)
    return placed


@compilable
def touches(parameters: Array, memory: Array, x: float, y: float, cos: float, sin: float) -> bool:
    """Whether the outline of the robot overlaps an obstacle, with the robot at x, y [m].

    ``cos`` and ``sin`` are those of its heading.
    """
    cell = cell_at(block(parameters, layout.GRID), x, y)
    if cell < 0:
        return False
    starts = block(parameters, layout.CONTACT_STARTS)
    first = int(starts[cell])
    end = int(starts[cell + 1])
    if first == end:
        return False
    entries = block(parameters, layout.CONTACT_ENTRIES)
    footprints = block(parameters, layout.FOOTPRINTS).reshape((-1, FOOTPRINT_SIZE))
    corners = block(parameters, layout.CORNERS).reshape((-1, 2))
    placed = placed_outline(parameters, memory)
    is_placed = False
    for entry in range(first, end):
        row = footprints[int(entries[entry])]
        dx = row[CENTRE_X] - x
        dy = row[CENTRE_Y] - y
        near = parameters[layout.OUTLINE_RADIUS] + row[CIRCLE]
        if dx * dx + dy * dy > near * near:
            continue
        if not is_placed:
            place_outline(parameters, memory, x, y, cos, sin)
            is_placed = True
        polygon = corners[int(row[START]) : int(row[END])]
        if polygon_distance(placed, polygon, row[RADIUS]) <= row[RADIUS]:
            return True
    return False
