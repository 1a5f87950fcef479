"""How a contact moves a body over the ground in the plane, by the friction below it.

Friction with the ground acts by its limit surface (Goyal, Ruina and Papadopoulos, Wear 143, 1991),
taken for an ellipsoid (Howe and Cutkosky, International Journal of Robotics Research 15, 1996). So
a push with a force f at r from the centre of friction moves the body by f, and turns it by
(r x f) / c^2, in the same unit of length; c is the largest moment of friction by the largest force.
The contact sticks or slides by Coulomb's law (Lynch, Maekawa and Tanie, IROS 1992).
"""

import math

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.simulator.engines import planar_bodies as layout
from evoros.simulator.engines.planar_bodies import memory_views, part_of, place_body

MAX_TURN = 0.3  # [rad] of a body by one contact in a sweep


@compilable
def move_body(
    pushing: Array,
    memory: Array,
    number: int,
    depth: float,
    nx: float,
    ny: float,
    along: float,
    side: float,
    drag: float,
    friction: float,
) -> None:
    """Move a body by ``depth`` [m] along the normal at a point of contact, and turn it.

    The point is given by its places along the normal and along its left-hand perpendicular [m]. The
    contact drags it by ``drag`` [m] along that perpendicular, if its coefficient of friction
    suffices.
    """
    poses, _, _, _, _ = memory_views(pushing, memory)
    bodies = part_of(pushing, layout.BODIES).reshape((-1, layout.BODY_SIZE))
    x = poses[number, layout.BODY_X]
    y = poses[number, layout.BODY_Y]
    # The arms of a force along the perpendicular and of one along the normal.
    arm = along - (x * nx + y * ny)
    lever = -(side - (y * nx - x * ny))
    squared = max(bodies[number, layout.ARM_SQUARED], 1e-6)
    nn = 1.0 + lever * lever / squared
    nt = lever * arm / squared
    tt = 1.0 + arm * arm / squared
    whole = nn * tt - nt * nt
    force = (tt * depth - nt * drag) / whole
    across = (nn * drag - nt * depth) / whole
    if friction == 0.0:
        force = depth / nn
        across = 0.0
    elif force <= 0.0 or abs(across) > friction * force:
        edge = friction if across > 0.0 else -friction
        share = nn + edge * nt
        if share < 0.1:  # wedged
            edge = 0.0
            share = nn
        force = depth / share
        across = edge * force
    turn = (lever * force + arm * across) / squared
    turn = min(max(turn, -MAX_TURN), MAX_TURN)
    cos = poses[number, layout.BODY_COS]
    sin = poses[number, layout.BODY_SIN]
    turn_sin, turn_cos = elementary.sin_cos(turn)
    new_cos = cos * turn_cos - sin * turn_sin
    new_sin = sin * turn_cos + cos * turn_sin
    length = math.sqrt(new_cos * new_cos + new_sin * new_sin)
    poses[number, layout.BODY_X] = x + force * nx - across * ny
    poses[number, layout.BODY_Y] = y + force * ny + across * nx
    poses[number, layout.BODY_COS] = new_cos / length
    poses[number, layout.BODY_SIN] = new_sin / length
    place_body(pushing, memory, number)
