"""The rule by which walkers move: the same in all simulators, compiled or not.

A walker never walks deeper into what it overlaps, but along it.
"""

import math

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.base.packing import unpack
from evoros.geometry.grid import cell_at
from evoros.walkers import layout as at
from evoros.walkers.forces import steer
from evoros.walkers.layout import Walk, Walking
from evoros.walkers.nearness import find_obstacle, find_robot, is_near
from evoros.walkers.scripts import act

SLIDES = 3  # times that a step is turned off what it would walk into


@compilable
def walk(parameters: Array, memory: Array, robots: Array, step: float) -> None:
    """Move all walkers by a step [s]; ``robots`` (r, 4) are x, y, cosine and sine of the yaw."""
    walkers = unpack(Walk, parameters).walkers
    for i in range(len(walkers)):
        if walkers[i, at.KIND] == at.WALKING:
            steer(parameters, memory, robots, i, step)
    for i in range(len(walkers)):
        if walkers[i, at.KIND] == at.WALKING:
            advance_walker(parameters, memory, robots, i, step)
        elif walkers[i, at.KIND] == at.ACTING:
            act(parameters, memory, robots, i, step)


@compilable
def advance_walker(parameters: Array, memory: Array, robots: Array, i: int, step: float) -> None:
    """Move a walker by its next velocity, along what it would walk into."""
    now = unpack(Walking, memory)
    motion = now.motions[i]
    x = now.places[i, 0]
    y = now.places[i, 1]
    vx = motion[at.NEXT_X]
    vy = motion[at.NEXT_Y]
    free = False
    for _ in range(SLIDES):
        nx, ny = find_barrier(parameters, memory, robots, i, x + vx * step, y + vy * step)
        free = nx == 0.0 and ny == 0.0
        if free:
            break
        into = min(vx * nx + vy * ny, 0.0)
        vx -= into * nx
        vy -= into * ny
    if not free:
        nx, ny = find_barrier(parameters, memory, robots, i, x + vx * step, y + vy * step)
        if nx != 0.0 or ny != 0.0:
            vx = 0.0
            vy = 0.0
    motion[at.VELOCITY_X] = vx
    motion[at.VELOCITY_Y] = vy
    now.places[i, 0] = x + vx * step
    now.places[i, 1] = y + vy * step


@compilable
def find_barrier(
    parameters: Array, memory: Array, robots: Array, i: int, x: float, y: float
) -> tuple[float, float]:
    """Return the way off what keeps a walker from a place, or zeros if it is free.

    A robot does so if the walker overlaps it and would walk deeper into it.
    """
    crowd, now = unpack(Walk, parameters), unpack(Walking, memory)
    radius = crowd.walkers[i, at.RADIUS]
    here_x = now.places[i, 0]
    here_y = now.places[i, 1]
    cell = cell_at(crowd.grid, here_x, here_y)
    for entry in range(
        int(crowd.starts[cell]) if cell >= 0 else 0, int(crowd.starts[cell + 1]) if cell >= 0 else 0
    ):
        row = int(crowd.entries[entry])
        if is_near(crowd.footprints[row], x, y, radius):
            before, nx, ny = find_obstacle(parameters, row, here_x, here_y)
            after, _, _ = find_obstacle(parameters, row, x, y)
            if after < radius and after < before:
                return nx, ny
    for robot in range(len(robots)):
        before, nx, ny = find_robot(parameters, robots, robot, here_x, here_y)
        after, _, _ = find_robot(parameters, robots, robot, x, y)
        if before < radius and after < before:
            return nx, ny
    for j in range(len(crowd.walkers)):
        if j == i or crowd.walkers[j, at.KIND] == at.ABSENT:
            continue
        reach = radius + crowd.walkers[j, at.RADIUS]
        rx = here_x - now.places[j, 0]
        ry = here_y - now.places[j, 1]
        sx = x - now.places[j, 0]
        sy = y - now.places[j, 1]
        before = math.sqrt(rx * rx + ry * ry)
        after = math.sqrt(sx * sx + sy * sy)
        if after < reach and after < before:
            return rx / before, ry / before
    return 0.0, 0.0
