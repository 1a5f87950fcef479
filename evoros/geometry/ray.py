"""Ray casting against solid shapes, with identical results compiled and interpreted."""

import math

from evoros.base.arrays import Array
from evoros.base.compilable import compilable

# A row of OBSTACLE_SIZE values describes an obstacle in the world frame.
KIND, AT_X, AT_Y, AT_Z, BOUND, ROTATION = range(6)
"""Kind; centre and radius [m] of the footprint's bounding circle; rotation matrix (3, 3)."""
EXTENT = ROTATION + 9
"""Box: half lengths [m]; cylinder: radius, half length; sphere: radius; polyhedron: face range."""
OBSTACLE_SIZE = EXTENT + 3
BOX, CYLINDER, SPHERE, CONVEX = 0.0, 1.0, 2.0, 3.0
Frame = tuple[float, float, float, float, float, float, float, float, float]
"""The rows of a rotation matrix."""
Point = tuple[float, float, float]  # x, y, z [m]
MARGIN_M = 1e-9  # upper bound [m] on rounding errors of distances
FACE_SIZE = 4  # values of a face: outward normal (3,), and distance [m] from the solid's origin


@compilable
def place_obstacle(obstacle: Array, x: float, y: float, cos: float, sin: float, row: Array) -> None:
    """Write an obstacle, rotated about the vertical axis and moved by x, y [m], into ``row``."""
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
    origin: Point,
    rays: Array,
    best: float,
    ranges: Array,
) -> float:
    """Return the distance [m] from a sensor to an obstacle, at most ``best``.

    If ``ranges`` is not empty, it holds one distance per ray: the function lowers the distance of
    each ray that hits the obstacle earlier, and ignores ``best``. ``faces`` (f, FACE_SIZE) holds
    the faces of all polyhedra. The rays (n, 3) are unit vectors in the rays' frame (see
    ``turn_frame``); ``origin`` is relative to the obstacle's centre, in the same frame. A ray that
    starts inside the obstacle does not hit it.
    """
    start, kind = _turn(frame, origin), obstacle[KIND]
    a, b, c = obstacle[EXTENT], obstacle[EXTENT + 1], obstacle[EXTENT + 2]
    for i in range(len(rays)):
        if len(ranges) > 0:
            best = ranges[i]
        way = _turn(frame, (rays[i, 0], rays[i, 1], rays[i, 2]))
        # Inlined: as a separate function, the compiled code takes 50 % longer.
        if kind == BOX:
            if not _falls_short(start, way, (a, b, c), best):
                best = _intersect_box(start, way, (a, b, c), best)
        elif kind == CYLINDER:
            best = _intersect_cylinder(start, way, a, b, best)
        elif kind == CONVEX:
            best = _intersect_polyhedron(start, way, faces[int(a) : int(b)], best)
        else:
            best = _intersect_sphere(start, way, a, best)
        if len(ranges) > 0:
            ranges[i] = best
    return best


@compilable
def _turn(frame: Frame, vector: Point) -> Point:
    m00, m01, m02, m10, m11, m12, m20, m21, m22 = frame
    x, y, z = vector
    return m00 * x + m01 * y + m02 * z, m10 * x + m11 * y + m12 * z, m20 * x + m21 * y + m22 * z


@compilable
def is_beside(box: Array, frame: Frame, x: float, y: float, across: float, along: float) -> bool:
    """Return True if a box at (x, y) [m] lies on the (across, along) side of a vertical plane."""
    m00, m01, _, m10, m11, _, m20, m21, _ = frame
    half = box[EXTENT] * abs(m00 * across + m01 * along)
    half += box[EXTENT + 1] * abs(m10 * across + m11 * along)
    half += box[EXTENT + 2] * abs(m20 * across + m21 * along)
    return bool(x * across + y * along > half + MARGIN_M)


@compilable
def is_beyond(box: Array, frame: Frame, centre: Point, distance: float) -> bool:
    """Return True only if a box at ``centre`` in the rays' frame is beyond ``distance`` [m]."""
    x, y, _ = _turn(frame, centre)
    far = distance + MARGIN_M
    return bool(abs(x) - box[EXTENT] > far or abs(y) - box[EXTENT + 1] > far)


@compilable
def turn_frame(obstacle: Array, cos: float, sin: float) -> Frame:
    """Return the rotation from the rays' frame, turned left by an angle, to an obstacle's frame."""
    r = ROTATION
    # transpose of the obstacle's rotation times the rotation of the rays' frame
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
def _falls_short(origin: Point, way: Point, half: Point, best: float) -> bool:
    """Return True only if a ray misses a box within ``best`` [m]; avoids divisions."""
    return (
        _stays_beside(origin[0], way[0], half[0], best)
        or _stays_beside(origin[1], way[1], half[1], best)
        or _stays_beside(origin[2], way[2], half[2], best)
    )


@compilable
def _stays_beside(origin: float, direction: float, half: float, best: float) -> bool:
    """Return True only if a ray misses a slab of half width ``half`` [m] within ``best`` [m]."""
    outside = abs(origin) - half - MARGIN_M
    towards = -direction if origin > 0.0 else direction
    return outside > 0.0 and (towards <= 0.0 or towards * best < outside)


@compilable
def _intersect_box(origin: Point, way: Point, half: Point, best: float) -> float:
    """Return the distance [m] along a ray to a box with half lengths [m], at most ``best``."""
    near, far = _clip(origin[0], way[0], half[0], -math.inf, best)
    if near > far or far < 0.0:
        return best
    near, far = _clip(origin[1], way[1], half[1], near, far)
    if near > far or far < 0.0:
        return best
    near, far = _clip(origin[2], way[2], half[2], near, far)
    return near if 0.0 <= near <= far else best


@compilable
def _intersect_cylinder(
    origin: Point, way: Point, radius: float, half_length: float, best: float
) -> float:
    """Return the distance [m] along a ray to a cylinder about the z axis, at most ``best``."""
    ox, oy, oz = origin
    ux, uy, uz = way
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
def _intersect_sphere(origin: Point, way: Point, radius: float, best: float) -> float:
    """Return the distance [m] along a ray to a sphere, at most ``best``."""
    ox, oy, oz = origin
    along = ox * way[0] + oy * way[1] + oz * way[2]
    root = along * along - (ox * ox + oy * oy + oz * oz - radius * radius)
    if root < 0.0:
        return best
    near = -along - math.sqrt(root)
    return near if 0.0 <= near <= best else best


@compilable
def _intersect_polyhedron(origin: Point, way: Point, faces: Array, best: float) -> float:
    """Return the distance [m] along a ray to a convex polyhedron, at most ``best``."""
    near = -math.inf
    far = best
    for i in range(len(faces)):
        a, b, c = faces[i, 0], faces[i, 1], faces[i, 2]
        outside = a * origin[0] + b * origin[1] + c * origin[2] - faces[i, 3]
        approach = a * way[0] + b * way[1] + c * way[2]
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
    """Clip a ray between ``near`` and ``far`` [m] to a slab of half width ``half`` [m]."""
    if direction != 0.0:
        middle = -origin / direction
        reach = abs(half / direction)
        return max(near, middle - reach), min(far, middle + reach)
    if abs(origin) > half:
        return math.inf, far
    return near, far
