"""The rule that moves walkers in all simulators; walkers slide along obstacles."""

import math

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.base.packing import unpack
from evoros.geometry.grid import cell_at
from evoros.walkers import layout as at
from evoros.walkers.forces import find_obstacle, find_robot, is_near, steer
from evoros.walkers.layout import Walk, Walking

_FASTEST_MPS = 10.0  # speed of an actor above which it jumps to the start of the next round
SLIDES = 3  # maximum number of deflections per step


@compilable
def walk(parameters: Array, memory: Array, robots: Array, step: float) -> None:
    """Move all walkers by a step [s]; ``robots`` (r, 4) has x, y, cosine and sine of the yaw."""
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
    """Move a walker at its next velocity; obstacles deflect it."""
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
    """Return the direction away from the object that blocks a position; zeros if it is free."""
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


@compilable
def act(parameters: Array, memory: Array, robots: Array, i: int, step: float) -> None:
    """Move an actor along its script, which pauses while a robot is in the way."""
    walker = unpack(Walk, parameters).walkers[i]
    now = unpack(Walking, memory)
    motion = now.motions[i]
    here_x = now.places[i, 0]
    here_y = now.places[i, 1]
    x, y = _find_scripted(parameters, i, motion[at.CLOCK] + step)
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
    reach = _FASTEST_MPS * step
    if dx * dx + dy * dy < reach * reach:
        motion[at.VELOCITY_X] = dx / step
        motion[at.VELOCITY_Y] = dy / step
    now.places[i, 0] = x
    now.places[i, 1] = y


@compilable
def _find_scripted(parameters: Array, i: int, clock: float) -> tuple[float, float]:
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
