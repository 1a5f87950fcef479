"""How a contact moves a body over the ground in the plane, by the friction below it.

Friction with the ground acts by its limit surface (Goyal, Ruina and Papadopoulos, Wear 143, 1991),
taken for an ellipsoid (Howe and Cutkosky, International Journal of Robotics Research 15, 1996). So
a push with a force f at r from the centre of friction moves the body by f, and turns it by
(r x f) / c^2, in the same unit of length; c is the largest moment of friction by the largest force.
The contact sticks or slides by Coulomb's law (Lynch, Maekawa and Tanie, IROS 1992).
"""

import math
from typing import NamedTuple

from evoros.base import elementary
from evoros.base.compilable import compilable
from evoros.simulator.engines import planar_bodies as bodies
from evoros.simulator.engines.planar_bodies import Movables, Placed, place_body, pose_of

MAX_TURN = 0.3  # [rad] of a body by one contact in a sweep


class Push(NamedTuple):
    """A contact that pushes a body."""

    depth: float  # [m] by which the body has to move along the normal
    nx: float  # the normal
    ny: float
    along: float  # [m] the place of the contact along the normal
    side: float  # [m] and along its left-hand perpendicular
    drag: float  # [m] by which the contact drags the body along that, if friction suffices
    friction: float  # the coefficient


@compilable
def move_body(movables: Movables, placed: Placed, index: int, push: Push) -> None:
    """Move a body along the normal at a point of contact, and turn it."""
    x, y, cos, sin = pose_of(placed, index)
    # The arms of a force along the perpendicular and of one along the normal.
    arm = push.along - (x * push.nx + y * push.ny)
    lever = -(push.side - (y * push.nx - x * push.ny))
    squared = max(movables.bodies[index, bodies.ARM_SQUARED], 1e-6)
    force, across = solve_contact(push, arm, lever, squared)
    turn = (lever * force + arm * across) / squared
    turn_sin, turn_cos = elementary.sin_cos(min(max(turn, -MAX_TURN), MAX_TURN))
    new_cos = cos * turn_cos - sin * turn_sin
    new_sin = sin * turn_cos + cos * turn_sin
    length = math.sqrt(new_cos * new_cos + new_sin * new_sin)
    pose = placed.poses[index]
    pose[bodies.BODY_X] = x + force * push.nx - across * push.ny
    pose[bodies.BODY_Y] = y + force * push.ny + across * push.nx
    pose[bodies.BODY_COS] = new_cos / length
    pose[bodies.BODY_SIN] = new_sin / length
    place_body(movables, placed, index)


@compilable
def solve_contact(push: Push, arm: float, lever: float, squared: float) -> tuple[float, float]:
    """Return how far [m] a contact moves a body along its normal and across it."""
    nn = 1.0 + lever * lever / squared
    nt = lever * arm / squared
    tt = 1.0 + arm * arm / squared
    whole = nn * tt - nt * nt
    force = (tt * push.depth - nt * push.drag) / whole
    across = (nn * push.drag - nt * push.depth) / whole
    if push.friction == 0.0:
        return push.depth / nn, 0.0
    if force <= 0.0 or abs(across) > push.friction * force:
        edge = push.friction if across > 0.0 else -push.friction
        share = nn + edge * nt
        if share < 0.1:  # wedged
            edge = 0.0
            share = nn
        force = push.depth / share
        across = edge * force
    return force, across
