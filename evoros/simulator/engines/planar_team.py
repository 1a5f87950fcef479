"""The rules of several robots in the plane, over the arrays that ``planar_team_layout`` describes.

In each step, the robots move one after another, in their order. A robot does not push another one:
it does not make a step into the outline of another robot, where that is then, and stops.
They give the same bits compiled and interpreted, and to robots that are far apart those of
``planar_rules``.
"""

from evoros.base import elementary
from evoros.base.arrays import COMMAND_SIZE, CONTACT, STATE_SIZE, YAW, Array, X, Y
from evoros.base.compilable import compilable
from evoros.geometry.polygon import polygon_distance
from evoros.geometry.ray import OBSTACLE_SIZE, place_obstacle
from evoros.simulator.engines import planar_layout as layout
from evoros.simulator.engines.planar_beams import BEAM_SIZE, GROUP_SIZE
from evoros.simulator.engines.planar_layout import block
from evoros.simulator.engines.planar_rules import (
    move,
    observe,
    place_outline,
    predict,
    stop,
    touches,
)
from evoros.simulator.engines.planar_sensing import detect, raise_to_minimum, sense_obstacles
from evoros.simulator.engines.planar_signals import feel, feel_outline, fill_signals
from evoros.simulator.engines.planar_team_layout import (
    EXTENT,
    MEMORY,
    PARAMETERS,
    SHAPES,
    SIGHT,
    SIGNALS,
    part,
    shapes_of,
    table_of,
)


def observe_team(parameters: Array, memory: Array, states: Array) -> None:
    """Copy the states of all robots and clear their contacts."""
    table = table_of(parameters)
    for i in range(len(table) - 1):
        own = part(parameters, table, i, PARAMETERS)
        state = states[i * STATE_SIZE : (i + 1) * STATE_SIZE]
        observe(own, part(memory, table, i, MEMORY), state)


def sense_team(parameters: Array, memory: Array, signals: Array) -> None:
    """Fill ``signals`` with those of all robots.

    First comes the nearest hit [m] of each beam, on obstacles and on other robots.
    """
    table = table_of(parameters)
    for i in range(len(table) - 1):
        place_shapes(parameters, memory, table, i)
    for i in range(len(table) - 1):
        own = part(parameters, table, i, PARAMETERS)
        state = part(memory, table, i, MEMORY)
        sensed = part(signals, table, i, SIGNALS)
        seen = sensed[: len(block(own, layout.BEAMS)) // BEAM_SIZE]
        sense_obstacles(own, state, seen)
        sense_robots(parameters, memory, table, i, seen)
        raise_to_minimum(own, seen)
        fill_signals(own, state, sensed)


def advance_team(parameters: Array, memory: Array, commands: Array, duration: float) -> None:
    """Drive all robots for ``duration`` [s]; a step into an obstacle or a robot is not made."""
    table = table_of(parameters)
    step = parameters[int(table[0, PARAMETERS]) + layout.TIME_STEP]
    for _ in range(round(duration / step)):
        for i in range(len(table) - 1):
            own = part(parameters, table, i, PARAMETERS)
            state = part(memory, table, i, MEMORY)
            command = commands[i * COMMAND_SIZE : (i + 1) * COMMAND_SIZE]
            pose = predict(
                own, state, command, elementary.cos(state[YAW]), elementary.sin(state[YAW])
            )
            x, y, _, cos, sin = pose
            blocked = touches(own, state, x, y, cos, sin)
            if touch_robots(parameters, memory, table, i, (x, y, cos, sin)):
                blocked = True
            if blocked:
                state[CONTACT] = 1.0
                feel(own, state, place_outline(own, state, x, y, cos, sin), x, y, cos, sin)
                stop(state)
            else:
                move(own, state, pose)


@compilable
def touch_robots(
    parameters: Array,
    memory: Array,
    table: Array,
    number: int,
    pose: tuple[float, float, float, float],
) -> bool:
    """Whether a robot at a pose overlaps another one; each that it overlaps has a contact.

    The pose is x, y [m] and the cosine and sine of the heading.
    """
    own = part(parameters, table, number, PARAMETERS)
    state = part(memory, table, number, MEMORY)
    x, y, cos, sin = pose
    found = False
    for i in range(len(table) - 1):
        other = part(parameters, table, i, PARAMETERS)
        there = part(memory, table, i, MEMORY)
        dx = there[X] - x
        dy = there[Y] - y
        near = own[layout.OUTLINE_RADIUS] + other[layout.OUTLINE_RADIUS]
        if i == number or dx * dx + dy * dy > near * near:
            continue
        yaw = there[YAW]
        first = place_outline(own, state, x, y, cos, sin)
        second = place_outline(
            other, there, there[X], there[Y], elementary.cos(yaw), elementary.sin(yaw)
        )
        if polygon_distance(first, second, 0.0) <= 0.0:
            feel_outline(own, state, first, second, 0.0, x, y, cos, sin)
            feel_outline(
                other,
                there,
                second,
                first,
                0.0,
                there[X],
                there[Y],
                elementary.cos(yaw),
                elementary.sin(yaw),
            )
            there[CONTACT] = 1.0
            found = True
    return found


@compilable
def place_shapes(parameters: Array, memory: Array, table: Array, number: int) -> None:
    """Move the shapes of a robot to where it is."""
    shapes, _ = shapes_of(parameters, table)
    placed = memory[int(table[-1, MEMORY]) :].reshape((-1, OBSTACLE_SIZE))
    state = part(memory, table, number, MEMORY)
    sin, cos = elementary.sin_cos(state[YAW])
    for i in range(int(table[number, SHAPES]), int(table[number + 1, SHAPES])):
        place_obstacle(shapes[i], state[X], state[Y], cos, sin, placed[i])


@compilable
def sense_robots(
    parameters: Array, memory: Array, table: Array, number: int, ranges: Array
) -> None:
    """Lower each range [m] of a robot whose beam sees any other robot at a shorter range."""
    state = part(memory, table, number, MEMORY)
    for other in range(len(table) - 1):
        dx = memory[int(table[other, MEMORY]) + X] - state[X]
        dy = memory[int(table[other, MEMORY]) + Y] - state[Y]
        reach = table[number, SIGHT] + table[other, EXTENT]
        if other != number and dx * dx + dy * dy < reach * reach:
            sense_robot(parameters, memory, table, number, other, ranges)


@compilable
def sense_robot(
    parameters: Array, memory: Array, table: Array, number: int, other: int, ranges: Array
) -> None:
    """Lower each range [m] of a robot whose beam sees another robot at a shorter range."""
    own = part(parameters, table, number, PARAMETERS)
    state = part(memory, table, number, MEMORY)
    placed = memory[int(table[-1, MEMORY]) :].reshape((-1, OBSTACLE_SIZE))
    _, faces = shapes_of(parameters, table)
    groups = block(own, layout.GROUPS).reshape((-1, GROUP_SIZE))
    beams = block(own, layout.BEAMS).reshape((-1, BEAM_SIZE))
    rays = block(own, layout.RAYS).reshape((-1, 3))
    sin, cos = elementary.sin_cos(state[YAW])
    for i in range(int(table[other, SHAPES]), int(table[other + 1, SHAPES])):
        shape = placed[i]
        detect(shape, faces, state[X], state[Y], cos, sin, groups, beams, rays, ranges)
