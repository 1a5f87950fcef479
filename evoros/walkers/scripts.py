"""How an actor moves, by the times of its script."""

import math

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.base.packing import unpack
from evoros.walkers import layout as at
from evoros.walkers.layout import Walk, Walking
from evoros.walkers.nearness import find_robot

FASTEST_MPS = 10.0
"""A faster one leaps to the start of another round."""


@compilable
def act(parameters: Array, memory: Array, robots: Array, i: int, step: float) -> None:
    """Move an actor by its script, whose time stands still while a robot is in its way."""
    walker = unpack(Walk, parameters).walkers[i]
    now = unpack(Walking, memory)
    motion = now.motions[i]
    here_x = now.places[i, 0]
    here_y = now.places[i, 1]
    x, y = find_scripted(parameters, i, motion[at.CLOCK] + step)
    motion[at.VELOCITY_X] = 0.0
    motion[at.VELOCITY_Y] = 0.0
    for robot in range(len(robots)):
        before, _, _ = find_robot(parameters, robots, robot, here_x, here_y)
        after, _, _ = find_robot(parameters, robots, robot, x, y)
        if after < 0.0 or (before < walker[at.RADIUS] and after < before):
            return
    motion[at.CLOCK] += step
    dx = x - here_x
    dy = y - here_y
    reach = FASTEST_MPS * step
    if dx * dx + dy * dy < reach * reach:
        motion[at.VELOCITY_X] = dx / step
        motion[at.VELOCITY_Y] = dy / step
    now.places[i, 0] = x
    now.places[i, 1] = y


@compilable
def find_scripted(parameters: Array, i: int, clock: float) -> tuple[float, float]:
    """Return where an actor is at a time [s] of its script."""
    crowd = unpack(Walk, parameters)
    walker = crowd.walkers[i]
    first, end = int(walker[at.FIRST]), int(walker[at.END])
    corners = crowd.corners
    start = corners[first, at.CORNER_S]
    time = clock
    whole = walker[at.DELAY] + corners[end - 1, at.CORNER_S]
    if walker[at.LOOPS] > 0.0 and whole > 0.0:
        time -= whole * math.floor(time / whole)
    time -= walker[at.DELAY]
    if time <= start:
        return corners[first, at.CORNER_X], corners[first, at.CORNER_Y]
    for k in range(first + 1, end):
        late = corners[k, at.CORNER_S]
        if time <= late:
            early = corners[k - 1, at.CORNER_S]
            share = (time - early) / (late - early)
            x = corners[k - 1, at.CORNER_X]
            y = corners[k - 1, at.CORNER_Y]
            dx = corners[k, at.CORNER_X] - x
            dy = corners[k, at.CORNER_Y] - y
            return x + share * dx, y + share * dy
    return corners[end - 1, at.CORNER_X], corners[end - 1, at.CORNER_Y]
