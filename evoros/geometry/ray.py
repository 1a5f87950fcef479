"""Ray casting against solid shapes. Runs compiled and interpreted alike."""

import math

from evoros.base.arrays import Array
from evoros.base.compilable import compilable

# One obstacle for ray casting: a row of OBSTACLE_SIZE values, in the world's frame.
KIND, AT_X, AT_Y, AT_Z, BOUND, ROTATION = range(6)
"""Kind, centre [m], radius [m] of the circle around its footprint, rotation by rows (3, 3)."""
EXTENT = ROTATION + 9
"""Half lengths of a box; radius and half length of a cylinder; radius of a sphere [m]; the first
row of a polyhedron in the array of faces and the row after its last."""
OBSTACLE_SIZE = EXTENT + 3
BOX, CYLINDER, SPHERE, CONVEX = 0.0, 1.0, 2.0, 3.0
Frame = tuple[float, float, float, float, float, float, float, float, float]
"""The rows of a rotation."""
MARGIN_M = 1e-9
"""More than rounding can change a distance: what is farther away by it is so in any case."""
FACE_SIZE = 4
"""A face of a polyhedron: its outward normal (3,), and its distance [m] from the origin of the
polyhedron's frame along that normal."""


@compilable
def place_obstacle(obstacle: Array, x: float, y: float, cos: float, sin: float, row: Array) -> None:
    """Turn the row of an obstacle about the vertical and move it by x, y [m] into ``row``."""
    for i in range(OBSTACLE_SIZE):
        row[i] = obstacle[i]
    row[AT_X] = x + cos * obstacle[AT_X] - sin * obstacle[AT_Y]
    row[AT_Y] = y + sin * obstacle[AT_X] + cos * obstacle[AT_Y]
    for i in range(ROTATION, ROTATION + 3):
        row[i] = cos * obstacle[i] - sin * obstacle[i + 3]
        row[i + 3] = sin * obstacle[i] + cos * obstacle[i + 3]


@compilable
def cast_rays(
    obstacle: Array,
    faces: Array,
    frame: Frame,
    x: float,
    y: float,
    z: float,
    rays: Array,
    start: int,
    end: int,
    best: float,
    ranges: Array,
    target: int,
) -> float:
    """Return the minimum distance [m] from a sensor to an obstacle, or ``best`` if that is less.

    If ``target`` is not negative, each ray has a distance of its own: that of the first is
    ``ranges[target]``, which is lowered, and ``best`` does not count.

    ``faces`` (f, FACE_SIZE) are those of all polyhedra. The rays are ``rays[start:end]`` of (n, 3)
    unit vectors, whose frame ``turn_frame`` has turned; (x, y, z) [m] is their origin relative to
    the obstacle's centre, in that frame. A ray that starts inside the obstacle does not see it.
    """
    m00, m01, m02, m10, m11, m12, m20, m21, m22 = frame
    ox = m00 * x + m01 * y + m02 * z
    oy = m10 * x + m11 * y + m12 * z
    oz = m20 * x + m21 * y + m22 * z
    kind = obstacle[KIND]
    a = obstacle[EXTENT]
    b = obstacle[EXTENT + 1]
    c = obstacle[EXTENT + 2]
    for i in range(start, end):
        if target >= 0:
            best = ranges[target + i - start]
        dx = rays[i, 0]
        dy = rays[i, 1]
        dz = rays[i, 2]
        ux = m00 * dx + m01 * dy + m02 * dz
        uy = m10 * dx + m11 * dy + m12 * dz
        uz = m20 * dx + m21 * dy + m22 * dz
        # Not a function of its own, which would take half as long again when compiled.
        if kind == BOX:
            best = _intersect_box(ox, oy, oz, ux, uy, uz, a, b, c, best)
        elif kind == CYLINDER:
            best = _intersect_cylinder(ox, oy, oz, ux, uy, uz, a, b, best)
        elif kind == CONVEX:
            best = _intersect_polyhedron(ox, oy, oz, ux, uy, uz, faces[int(a) : int(b)], best)
        else:
            best = _intersect_sphere(ox, oy, oz, ux, uy, uz, a, best)
        if target >= 0:
            ranges[target + i - start] = best
    return best


@compilable
def is_beside(box: Array, frame: Frame, x: float, y: float, across: float, along: float) -> bool:
    """Whether a box, its centre at (x, y) [m], lies on one side of a vertical plane at the origin.

    (across, along) is the plane's unit normal, to that side. Both are in the frame of the rays.
    """
    m00, m01, _, m10, m11, _, m20, m21, _ = frame
    half = box[EXTENT] * abs(m00 * across + m01 * along)
    half += box[EXTENT + 1] * abs(m10 * across + m11 * along)
    half += box[EXTENT + 2] * abs(m20 * across + m21 * along)
    return bool(x * across + y * along > half + MARGIN_M)


@compilable
def is_beyond(box: Array, frame: Frame, x: float, y: float, z: float, distance: float) -> bool:
    """Whether a box, its centre at (x, y, z) [m], has no point within ``distance`` [m].

    It may have none if this is not known. The frame is that of the rays.
    """
    m00, m01, m02, m10, m11, m12, _, _, _ = frame
    far = distance + MARGIN_M
    return bool(
        abs(m00 * x + m01 * y + m02 * z) - box[EXTENT] > far
        or abs(m10 * x + m11 * y + m12 * z) - box[EXTENT + 1] > far
    )


@compilable
def turn_frame(obstacle: Array, cos: float, sin: float) -> Frame:
    """Return the rotation from the frame of the rays to that of an obstacle.

    The frame of the rays is turned to the left by the angle of ``cos`` and ``sin``.
    """
    r = ROTATION
    # The transpose of the obstacle's rotation, after the turn of the rays' frame.
    return (
        obstacle[r] * cos + obstacle[r + 3] * sin,
        obstacle[r + 3] * cos - obstacle[r] * sin,
        obstacle[r + 6],
        obstacle[r + 1] * cos + obstacle[r + 4] * sin,
        obstacle[r + 4] * cos - obstacle[r + 1] * sin,
        obstacle[r + 7],
        obstacle[r + 2] * cos + obstacle[r + 5] * sin,
        obstacle[r + 5] * cos - obstacle[r + 2] * sin,
        obstacle[r + 8],
    )


@compilable
def _intersect_box(
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
    """Return the distance from (ox, oy, oz) along (ux, uy, uz) to a box of half lengths a, b, c."""
    near, far = _clip(ox, ux, a, -math.inf, best)
    if near > far or far < 0.0:
        return best
    near, far = _clip(oy, uy, b, near, far)
    if near > far or far < 0.0:
        return best
    near, far = _clip(oz, uz, c, near, far)
    return near if 0.0 <= near <= far else best


@compilable
def _intersect_cylinder(
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
    """Return the distance to a cylinder about the z axis, like ``_intersect_box``."""
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
    near, far = _clip(oz, uz, half_length, near, far)
    return near if 0.0 <= near <= far else best


@compilable
def _intersect_sphere(
    ox: float,
    oy: float,
    oz: float,
    ux: float,
    uy: float,
    uz: float,
    radius: float,
    best: float,
) -> float:
    """Return the distance to a sphere, like ``_intersect_box``."""
    along = ox * ux + oy * uy + oz * uz
    root = along * along - (ox * ox + oy * oy + oz * oz - radius * radius)
    if root < 0.0:
        return best
    near = -along - math.sqrt(root)
    return near if 0.0 <= near <= best else best


@compilable
def _intersect_polyhedron(
    ox: float,
    oy: float,
    oz: float,
    ux: float,
    uy: float,
    uz: float,
    faces: Array,
    best: float,
) -> float:
    """Return the distance to the points inside all faces, like ``_intersect_box``."""
    near = -math.inf
    far = best
    for i in range(len(faces)):
        a = faces[i, 0]
        b = faces[i, 1]
        c = faces[i, 2]
        outside = a * ox + b * oy + c * oz - faces[i, 3]
        approach = a * ux + b * uy + c * uz
        if approach < 0.0:
            near = max(near, -outside / approach)
        elif approach > 0.0:
            far = min(far, -outside / approach)
        elif outside > 0.0:
            return best
        if near > far:
            return best
    return near if 0.0 <= near <= far else best


@compilable
def _clip(
    origin: float, direction: float, half: float, near: float, far: float
) -> tuple[float, float]:
    """Clip the part of a ray from ``near`` to ``far`` [m] to a slab, ``half`` [m] to each side."""
    if direction != 0.0:
        middle = -origin / direction
        reach = abs(half / direction)
        return max(near, middle - reach), min(far, middle + reach)
    if abs(origin) > half:
        return math.inf, far
    return near, far
