"""The rules of several robots in the plane among bodies that they can push.

Each robot pushes in its turn, as if it were alone, by ``planar_pushing``. Other robots do not
yield: a body that would be pushed into one of them stays, and stops the robot that pushes it. The
bodies are in the memory of every robot, and those of the others follow each push.
"""

from evoros.base import elementary
from evoros.base.arrays import COMMAND_SIZE, CONTACT, YAW, Array, X, Y
from evoros.base.compilable import compilable
from evoros.geometry.contact import polygon_contact
from evoros.simulator.engines import planar_bodies as bodies
from evoros.simulator.engines import planar_layout as layout
from evoros.simulator.engines.planar_beams import BEAM_SIZE
from evoros.simulator.engines.planar_bodies import memory_views, part_of
from evoros.simulator.engines.planar_layout import block
from evoros.simulator.engines.planar_pushing import (
    BLOCKED,
    PUSHED,
    TOLERANCE_M,
    UNTOUCHED,
    put_back,
)
from evoros.simulator.engines.planar_rules import (
    move,
    place_outline,
    predict,
    push,
    stop,
    touches,
)
from evoros.simulator.engines.planar_sensing import (
    moving_memory,
    raise_to_minimum,
    sense_bodies,
    sense_obstacles,
)
from evoros.simulator.engines.planar_signals import feel, feel_outline, fill_signals
from evoros.simulator.engines.planar_team import place_shapes, sense_robots, touch_robots
from evoros.simulator.engines.planar_team_layout import (
    MEMORY,
    PARAMETERS,
    SIGNALS,
    part,
    table_of,
)


def sense_team_pushing(parameters: Array, memory: Array, signals: Array) -> None:
    """Fill ``signals`` as ``sense_team`` does, among bodies that can be pushed."""
    table = table_of(parameters)
    for i in range(len(table) - 1):
        place_shapes(parameters, memory, table, i)
    for i in range(len(table) - 1):
        own = part(parameters, table, i, PARAMETERS)
        state = part(memory, table, i, MEMORY)
        sensed = part(signals, table, i, SIGNALS)
        seen = sensed[: len(block(own, layout.BEAMS)) // BEAM_SIZE]
        sense_obstacles(own, state, seen)
        if len(block(own, layout.PUSHING)):
            sense_bodies(own, state, seen)
        sense_robots(parameters, memory, table, i, seen)
        raise_to_minimum(own, seen)
        fill_signals(own, state, sensed)


def advance_team_pushing(
    parameters: Array, memory: Array, commands: Array, duration: float
) -> None:
    """Drive as ``advance_team`` does, among bodies that can be pushed."""
    table = table_of(parameters)
    step = parameters[int(table[0, PARAMETERS]) + layout.TIME_STEP]
    for _ in range(round(duration / step)):
        for i in range(len(table) - 1):
            own = part(parameters, table, i, PARAMETERS)
            state = part(memory, table, i, MEMORY)
            command = commands[i * COMMAND_SIZE : (i + 1) * COMMAND_SIZE]
            old_sin, old_cos = elementary.sin_cos(state[YAW])
            pose = predict(own, state, command, old_cos, old_sin)
            x, y, _, cos, sin = pose
            contact = UNTOUCHED
            if touches(own, state, x, y, cos, sin):
                contact = BLOCKED
            if touch_robots(parameters, memory, table, i, (x, y, cos, sin)):
                contact = BLOCKED
            if contact == UNTOUCHED and len(block(own, layout.PUSHING)):
                contact = push(own, state, (x, y, cos, sin), old_cos, old_sin)
            if contact == PUSHED:
                contact = settle_push(parameters, memory, table, i)
            if contact != UNTOUCHED:
                state[CONTACT] = 1.0
                feel(own, state, place_outline(own, state, x, y, cos, sin), x, y, cos, sin)
            if contact == BLOCKED:
                stop(state)
            else:
                move(own, state, pose)


@compilable
def settle_push(parameters: Array, memory: Array, table: Array, number: int) -> int:
    """Move the bodies in the memory of the other robots after a push by one, or put them back.

    Returns:
        PUSHED, or BLOCKED if a body would overlap another robot.
    """
    own = part(parameters, table, number, PARAMETERS)
    moved = part(memory, table, number, MEMORY)[moving_memory(own) :]
    if press_robots(parameters, memory, table, number, moved):
        put_back(block(own, layout.PUSHING), moved)
        return BLOCKED
    for i in range(len(table) - 1):
        if i != number:
            other = part(parameters, table, i, PARAMETERS)
            target = part(memory, table, i, MEMORY)[moving_memory(other) :]
            for k in range(len(target)):
                target[k] = moved[k]
    return PUSHED


@compilable
def press_robots(parameters: Array, memory: Array, table: Array, number: int, moved: Array) -> bool:
    """Whether bodies that a robot pushed overlap another one; each that they do has a contact."""
    pushing = block(part(parameters, table, number, PARAMETERS), layout.PUSHING)
    poses, _, levels, corners, _ = memory_views(pushing, moved)
    rows = part_of(pushing, bodies.BODIES).reshape((-1, bodies.BODY_SIZE))
    parts = part_of(pushing, bodies.PARTS).reshape((-1, bodies.PART_SIZE))
    found = False
    for i in range(len(table) - 1):
        other = part(parameters, table, i, PARAMETERS)
        there = part(memory, table, i, MEMORY)
        height = block(other, layout.PUSHING)[bodies.HEIGHT]
        x = there[X]
        y = there[Y]
        sin, cos = elementary.sin_cos(there[YAW])
        for body in range(len(levels)):
            dx = poses[body, bodies.BODY_X] - x
            dy = poses[body, bodies.BODY_Y] - y
            near = other[layout.OUTLINE_RADIUS] + rows[body, bodies.BODY_RADIUS]
            if i == number or levels[body] == 0.0 or dx * dx + dy * dy > near * near:
                continue
            outline = place_outline(other, there, x, y, cos, sin)
            for p in range(int(rows[body, bodies.FIRST_PART]), int(rows[body, bodies.END_PART])):
                if parts[p, bodies.BOTTOM] >= height or parts[p, bodies.TOP] <= 0.0:
                    continue
                polygon = corners[int(parts[p, bodies.START]) : int(parts[p, bodies.END])]
                radius = parts[p, bodies.RADIUS]
                if polygon_contact(outline, polygon, 0.0, radius)[0] > TOLERANCE_M:
                    feel_outline(other, there, outline, polygon, radius, x, y, cos, sin)
                    there[CONTACT] = 1.0
                    found = True
    return found
