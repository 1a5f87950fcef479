"""Rays against boxes, cylinders and spheres. Runs compiled and interpreted alike."""

import math

from evoros.base.arrays import Array
from evoros.base.compilation import compilable

# One obstacle as rays see it: a row of OBSTACLE_SIZE values, in the world's frame.
KIND, AT_X, AT_Y, AT_Z, BOUND, ROTATION = range(6)
"""Kind, centre [m], radius [m] of the circle around its footprint, rotation by rows (3, 3)."""
EXTENT = ROTATION + 9
"""Half lengths of a box; radius and half length of a cylinder; radius of a sphere [m]."""
OBSTACLE_SIZE = EXTENT + 3
BOX, CYLINDER, SPHERE = 0.0, 1.0, 2.0


@compilable
def first_hit(
    obstacle: Array,
    cos: float,
    sin: float,
    x: float,
    y: float,
    z: float,
    rays: Array,
    first: int,
    last: int,
    best: float,
) -> float:
    """The least distance [m] at which one of the rays meets the obstacle, or ``best`` if less.

    ``rays`` (n, 3), of which those from ``first`` to before ``last`` count, are unit vectors in a
    frame that is turned to the left by the angle of ``cos`` and ``sin``; (x, y, z) [m] is where
    they start, seen from the obstacle's centre, in that frame. A ray that starts inside the
    obstacle does not see it.
    """
    r = ROTATION
    # From the frame of the rays to that of the obstacle: the transposed rotation after the turn.
    m00 = obstacle[r] * cos + obstacle[r + 3] * sin
    m01 = obstacle[r + 3] * cos - obstacle[r] * sin
    m02 = obstacle[r + 6]
    m10 = obstacle[r + 1] * cos + obstacle[r + 4] * sin
    m11 = obstacle[r + 4] * cos - obstacle[r + 1] * sin
    m12 = obstacle[r + 7]
    m20 = obstacle[r + 2] * cos + obstacle[r + 5] * sin
    m21 = obstacle[r + 5] * cos - obstacle[r + 2] * sin
    m22 = obstacle[r + 8]
    ox = m00 * x + m01 * y + m02 * z
    oy = m10 * x + m11 * y + m12 * z
    oz = m20 * x + m21 * y + m22 * z
    kind = obstacle[KIND]
    a = obstacle[EXTENT]
    b = obstacle[EXTENT + 1]
    c = obstacle[EXTENT + 2]
    for i in range(first, last):
        dx = rays[i, 0]
        dy = rays[i, 1]
        dz = rays[i, 2]
        ux = m00 * dx + m01 * dy + m02 * dz
        uy = m10 * dx + m11 * dy + m12 * dz
        uz = m20 * dx + m21 * dy + m22 * dz
        if kind == BOX:
            best = meets_box(ox, oy, oz, ux, uy, uz, a, b, c, best)
        elif kind == CYLINDER:
            best = meets_cylinder(ox, oy, oz, ux, uy, uz, a, b, best)
        else:
            best = meets_sphere(ox, oy, oz, ux, uy, uz, a, best)
    return best


@compilable
def meets_box(
    ox: float,
    oy: float,
    oz: float,
    ux: float,
    uy: float,
    uz: float,
    a: float,
    b: float,
    c: float,
    best: float,
) -> float:
    """Distance from (ox, oy, oz) along (ux, uy, uz) to a box of half lengths a, b, c [m]."""
    near = -math.inf
    far = best
    if ux != 0.0:
        middle = -ox / ux
        half = abs(a / ux)
        near = middle - half
        far = min(far, middle + half)
    elif abs(ox) > a:
        return best
    if uy != 0.0:
        middle = -oy / uy
        half = abs(b / uy)
        near = max(near, middle - half)
        far = min(far, middle + half)
    elif abs(oy) > b:
        return best
    if uz != 0.0:
        middle = -oz / uz
        half = abs(c / uz)
        near = max(near, middle - half)
        far = min(far, middle + half)
    elif abs(oz) > c:
        return best
    return near if 0.0 <= near <= far else best


@compilable
def meets_cylinder(
    ox: float,
    oy: float,
    oz: float,
    ux: float,
    uy: float,
    uz: float,
    radius: float,
    half_length: float,
    best: float,
) -> float:
    """As ``meets_box``, with a cylinder about the z axis."""
    near = -math.inf
    far = best
    squared = ux * ux + uy * uy
    outside = ox * ox + oy * oy - radius * radius
    if squared > 0.0:
        along = ox * ux + oy * uy
        root = along * along - squared * outside
        if root < 0.0:
            return best
        root = math.sqrt(root)
        near = (-along - root) / squared
        far = min(far, (-along + root) / squared)
    elif outside > 0.0:
        return best
    if uz != 0.0:
        middle = -oz / uz
        half = abs(half_length / uz)
        near = max(near, middle - half)
        far = min(far, middle + half)
    elif abs(oz) > half_length:
        return best
    return near if 0.0 <= near <= far else best


@compilable
def meets_sphere(
    ox: float,
    oy: float,
    oz: float,
    ux: float,
    uy: float,
    uz: float,
    radius: float,
    best: float,
) -> float:
    """As ``meets_box``, with a sphere."""
    along = ox * ux + oy * uy + oz * uz
    root = along * along - (ox * ox + oy * oy + oz * oz - radius * radius)
    if root < 0.0:
        return best
    near = -along - math.sqrt(root)
    return near if 0.0 <= near <= best else best
