"""How far walkers are from robots and obstacles, and the way off these."""

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.base.packing import unpack
from evoros.geometry.outlines import CENTRE_X, CENTRE_Y, CIRCLE, END, RADIUS, START
from evoros.geometry.polygon import find_border
from evoros.walkers.layout import Walk


@compilable
def find_robot(
    parameters: Array, robots: Array, robot: int, x: float, y: float
) -> tuple[float, float, float]:
    """Return the distance [m] of a place from a robot's outline, negative inside, and the way off.

    The way off is a unit vector x, y in the world.
    """
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
    """Return the distance [m] of a place from an obstacle, negative inside, and the way off."""
    crowd = unpack(Walk, parameters)
    footprint = crowd.footprints[row]
    polygon = crowd.borders[int(footprint[START]) : int(footprint[END])]
    gap, nx, ny = find_border(polygon, x, y)
    return gap - footprint[RADIUS], nx, ny


@compilable
def is_near(footprint: Array, x: float, y: float, reach: float) -> bool:
    """Whether a footprint may lie within a distance [m] of a place."""
    dx = footprint[CENTRE_X] - x
    dy = footprint[CENTRE_Y] - y
    near = footprint[CIRCLE] + reach
    return bool(dx * dx + dy * dy <= near * near)
