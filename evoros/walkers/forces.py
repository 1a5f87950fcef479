"""The forces on a walker per unit mass, and the resulting velocity.

The model is that by Helbing and Molnar (Physical Review E 51, 4282, 1995) without random forces. In
addition, walkers evade obstacles ahead to the right, and turn back when blocked.
"""

import math

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.base.packing import unpack
from evoros.geometry.footprint import CENTRE_X, CENTRE_Y, CIRCLE, END, RADIUS, START
from evoros.geometry.grid import cell_at
from evoros.geometry.polygon import find_border
from evoros.walkers import layout as at
from evoros.walkers.layout import Walk, Walking

AHEAD_M = 1.0  # distance along the leg to the point that a walker heads for, to return to the leg
REACHED_M, PASSED_M = 0.3, 1.0  # distances [m] at a reached corner, before and after passing it
FOREIGN_REACH_M = 2.5  # distance [m] at which an obstacle's potential has fallen to e**-12
STRIDE_S = 2.0  # [s], time ahead for which others stay out of a walker's path, as in the paper
SIGHT_COS, UNSEEN = -0.17364817766693033, 0.5
"""The cosine of half the field of view (100 degrees), and the weight of forces from behind."""
SLOW, BLOCKED_S = 0.1, 3.0  # progress relative to the pace, and time [s] below it before turning
FASTEST = 1.3  # maximum speed relative to the pace, as in the paper
RIGHTWARDS = 0.3  # fraction of a force from ahead that is turned to the right
PERSON_M = 0.25  # [m], radius of a walker for which the distances equal the paper's


@compilable
def steer(parameters: Array, memory: Array, robots: Array, i: int, step: float) -> None:
    """Compute a walker's next velocity from the forces on it."""
    walker = unpack(Walk, parameters).walkers[i]
    motion = unpack(Walking, memory).motions[i]
    vx = motion[at.VELOCITY_X]
    vy = motion[at.VELOCITY_Y]
    ex, ey = find_heading(parameters, memory, i)
    wanted = walker[at.PACE]
    stops = waits(parameters, memory, robots, i, step)
    if stops:
        wanted = 0.0
    elif vx * ex + vy * ey < SLOW * walker[at.PACE]:
        motion[at.BLOCKED] += step
    else:
        motion[at.BLOCKED] = max(motion[at.BLOCKED] - step, 0.0)
    if motion[at.BLOCKED] > BLOCKED_S:
        turn_back(parameters, memory, i)
        ex, ey = find_heading(parameters, memory, i)
    fx = (wanted * ex - vx) / walker[at.RELAXATION]
    fy = (wanted * ey - vy) / walker[at.RELAXATION]
    if not stops:
        px, py = repel_by_walkers(parameters, memory, i, ex, ey)
        qx, qy = repel_by_robots(parameters, memory, robots, i, ex, ey)
        rx, ry = repel_by_borders(parameters, memory, i)
        fx += px + qx + rx
        fy += py + qy + ry
    vx += fx * step
    vy += fy * step
    speed = math.sqrt(vx * vx + vy * vy)
    limit = FASTEST * walker[at.PACE]
    if speed > limit:
        vx *= limit / speed
        vy *= limit / speed
    motion[at.NEXT_X] = vx
    motion[at.NEXT_Y] = vy


@compilable
def find_heading(parameters: Array, memory: Array, i: int) -> tuple[float, float]:
    """Update a walker's next corner; return the unit vector to its target point on the route."""
    crowd, now = unpack(Walk, parameters), unpack(Walking, memory)
    first, end = int(crowd.walkers[i, at.FIRST]), int(crowd.walkers[i, at.END])
    x = now.places[i, 0]
    y = now.places[i, 1]
    goal = int(now.motions[i, at.GOAL])
    hx = 0.0
    hy = 0.0
    for _ in range(2):
        before = follow(goal, first, end, now.motions[i, at.BACKWARDS] == 0.0)
        sx = crowd.corners[before, at.CORNER_X]
        sy = crowd.corners[before, at.CORNER_Y]
        dx = crowd.corners[goal, at.CORNER_X] - sx
        dy = crowd.corners[goal, at.CORNER_Y] - sy
        length = math.sqrt(dx * dx + dy * dy)
        along = ((x - sx) * dx + (y - sy) * dy) / length
        left_x = sx + dx - x
        left_y = sy + dy - y
        left = math.sqrt(left_x * left_x + left_y * left_y)
        if left > REACHED_M and (along < length or left > PASSED_M):
            share = min(max(along, 0.0) + AHEAD_M, length) / length
            hx = sx + share * dx - x
            hy = sy + share * dy - y
            break
        goal = follow(goal, first, end, now.motions[i, at.BACKWARDS] > 0.0)
        now.motions[i, at.GOAL] = goal
        hx = crowd.corners[goal, at.CORNER_X] - x
        hy = crowd.corners[goal, at.CORNER_Y] - y
    size = math.sqrt(hx * hx + hy * hy)
    if size == 0.0:
        return 1.0, 0.0
    return hx / size, hy / size


@compilable
def follow(corner: int, first: int, end: int, backwards: bool) -> int:
    """Return the next corner of a closed route, or the previous one if ``backwards``."""
    if backwards:
        return corner - 1 if corner > first else end - 1
    return corner + 1 if corner + 1 < end else first


@compilable
def turn_back(parameters: Array, memory: Array, i: int) -> None:
    """Reverse the direction in which a walker follows its route."""
    walker = unpack(Walk, parameters).walkers[i]
    motion = unpack(Walking, memory).motions[i]
    motion[at.BACKWARDS] = 1.0 - motion[at.BACKWARDS]
    backwards = motion[at.BACKWARDS] > 0.0
    first, end = int(walker[at.FIRST]), int(walker[at.END])
    motion[at.GOAL] = follow(int(motion[at.GOAL]), first, end, backwards)
    motion[at.BLOCKED] = 0.0


@compilable
def waits(parameters: Array, memory: Array, robots: Array, i: int, step: float) -> bool:
    """Return True if a walker waits for a nearby robot; the duration of waits is limited."""
    walker = unpack(Walk, parameters).walkers[i]
    motion = unpack(Walking, memory).motions[i]
    near = False
    if walker[at.STOP_GAP] > 0.0:
        for robot in range(len(robots)):
            place = unpack(Walking, memory).places[i]
            gap, _, _ = find_robot(parameters, robots, robot, place[0], place[1])
            near = near or gap - walker[at.RADIUS] < walker[at.STOP_GAP]
    if not near:
        motion[at.WAITED] = 0.0
        return False
    motion[at.WAITED] += step
    return bool(motion[at.WAITED] <= walker[at.PATIENCE])


@compilable
def repel_by_walkers(
    parameters: Array, memory: Array, i: int, ex: float, ey: float
) -> tuple[float, float]:
    """Return the force of all other walkers on a walker whose heading is (ex, ey)."""
    walkers, now = unpack(Walk, parameters).walkers, unpack(Walking, memory)
    walker = walkers[i]
    fx = 0.0
    fy = 0.0
    for j in range(len(walkers)):
        rx = now.places[i, 0] - now.places[j, 0]
        ry = now.places[i, 1] - now.places[j, 1]
        distance = math.sqrt(rx * rx + ry * ry)
        if j == i or walkers[j, at.KIND] == at.ABSENT or distance == 0.0:
            continue
        # Equipotential lines are ellipses with foci at the other walker and the end of its stride.
        wx = STRIDE_S * now.motions[j, at.VELOCITY_X]
        wy = STRIDE_S * now.motions[j, at.VELOCITY_Y]
        sx = rx - wx
        sy = ry - wy
        second = max(math.sqrt(sx * sx + sy * sy), 1e-6)
        whole = distance + second
        b = 0.5 * math.sqrt(max(whole * whole - wx * wx - wy * wy, 1e-6))
        narrower = b + 2.0 * PERSON_M - walker[at.RADIUS] - walkers[j, at.RADIUS]
        size = walker[at.REPULSION] / walker[at.RANGE] * decay(narrower / walker[at.RANGE])
        size *= whole / (4.0 * b)
        gx, gy = weigh(size * (rx / distance + sx / second), size * (ry / distance + sy / second),
                       ex, ey)  # fmt: skip
        fx += gx
        fy += gy
    return fx, fy


@compilable
def repel_by_robots(
    parameters: Array, memory: Array, robots: Array, i: int, ex: float, ey: float
) -> tuple[float, float]:
    """Return the force of the robots, as obstacles, on a walker whose heading is (ex, ey)."""
    walker = unpack(Walk, parameters).walkers[i]
    place = unpack(Walking, memory).places[i]
    fx = 0.0
    fy = 0.0
    for robot in range(len(robots) if walker[at.AVOIDS] > 0.0 else 0):
        gap, nx, ny = find_robot(parameters, robots, robot, place[0], place[1])
        size = push_off(walker, gap)
        gx, gy = weigh(size * nx, size * ny, ex, ey)
        fx += gx
        fy += gy
    return fx, fy


@compilable
def repel_by_borders(parameters: Array, memory: Array, i: int) -> tuple[float, float]:
    """Return the force of all obstacles near a walker."""
    crowd = unpack(Walk, parameters)
    x = unpack(Walking, memory).places[i, 0]
    y = unpack(Walking, memory).places[i, 1]
    fx = 0.0
    fy = 0.0
    cell = cell_at(crowd.grid, x, y)
    if cell < 0:
        return fx, fy
    for entry in range(int(crowd.starts[cell]), int(crowd.starts[cell + 1])):
        row = int(crowd.entries[entry])
        if is_near(crowd.footprints[row], x, y, FOREIGN_REACH_M):
            gap, nx, ny = find_obstacle(parameters, row, x, y)
            size = push_off(crowd.walkers[i], gap)
            fx += size * nx
            fy += size * ny
    return fx, fy


@compilable
def push_off(walker: Array, gap: float) -> float:
    """Return the magnitude of an obstacle's force, given its distance [m] to a walker's centre."""
    share = (gap + PERSON_M - walker[at.RADIUS]) / walker[at.BORDER_RANGE]
    return float(walker[at.BORDER_REPULSION] / walker[at.BORDER_RANGE] * decay(share))


@compilable
def decay(share: float) -> float:
    """Return e**-share, at most e**4, which limits the force during overlap."""
    return elementary.exp(-max(share, -4.0))


@compilable
def weigh(fx: float, fy: float, ex: float, ey: float) -> tuple[float, float]:
    """Weight a force on a walker whose heading is (ex, ey); turn forces from ahead to the right."""
    size = math.sqrt(fx * fx + fy * fy)
    ahead = -(fx * ex + fy * ey)
    if ahead < SIGHT_COS * size:
        return UNSEEN * fx, UNSEEN * fy
    if ahead <= 0.0:
        return fx, fy
    return fx + RIGHTWARDS * ahead * ey, fy - RIGHTWARDS * ahead * ex


@compilable
def find_robot(
    parameters: Array, robots: Array, robot: int, x: float, y: float
) -> tuple[float, float, float]:
    """Return the distance [m] to a robot's outline (negative inside) and the unit vector away."""
    crowd = unpack(Walk, parameters)
    outline = crowd.outlines[int(crowd.ends[robot]) : int(crowd.ends[robot + 1])]
    cos = robots[robot, 2]
    sin = robots[robot, 3]
    dx = x - robots[robot, 0]
    dy = y - robots[robot, 1]
    gap, nx, ny = find_border(outline, cos * dx + sin * dy, cos * dy - sin * dx)
    return gap, cos * nx - sin * ny, sin * nx + cos * ny


@compilable
def find_obstacle(parameters: Array, row: int, x: float, y: float) -> tuple[float, float, float]:
    """Return the distance [m] to an obstacle (negative inside) and the unit vector away from it."""
    crowd = unpack(Walk, parameters)
    footprint = crowd.footprints[row]
    polygon = crowd.borders[int(footprint[START]) : int(footprint[END])]
    gap, nx, ny = find_border(polygon, x, y)
    return gap - footprint[RADIUS], nx, ny


@compilable
def is_near(footprint: Array, x: float, y: float, reach: float) -> bool:
    """Return True if a footprint may be within ``reach`` [m] of a position."""
    dx = footprint[CENTRE_X] - x
    dy = footprint[CENTRE_Y] - y
    near = footprint[CIRCLE] + reach
    return bool(dx * dx + dy * dy <= near * near)
