"""The bodies of a world in PyBullet: their collision groups, and when they sleep."""

import math
from collections.abc import Sequence
from typing import Any

from evoros.geometry.footprint import bottom_height
from evoros.geometry.inertia import joint_moments
from evoros.geometry.shapes import Body, Shape, Vector
from evoros.simulator.engines.pybullet_shapes import create_shape, split_body
from evoros.world.model import World
from evoros.world.standing import GAP_M

# Collision groups. The engine casts rays in group 1, so no body is in that group. Wheels and
# casters that the chassis covers meet the ground only, the robot never meets itself, and fixed
# bodies never meet each other: such pairs cost time wherever walls touch each other or the ground.
RAY, ROBOT, GROUND, FIXED, MOVABLE = 1, 2, 4, 8, 16
VISIBLE = GROUND | FIXED | MOVABLE
MOVING = RAY | ROBOT | MOVABLE
ROBOT_BIT = 32
"""The group of the first of several robots, whose others have the next ones: robots meet the others
and not themselves."""

MARGIN_M = 1e-4
"""The margin around fixed polyhedra. With less, rays miss them. The engine's own, 1 mm, meets rays
that graze a floor centimetres too early."""
UPWARDS = 0.1  # a contact whose normal points up by less does not carry a body


MAX_FRICTION = 1.0
"""Gazebo takes the smaller of two coefficients and Bullet their product. So a coefficient of 100,
which many worlds have, must not multiply the wheels'."""


def add_body(bullet: Any, body: Body) -> list[int]:
    """Add one body of the world; returns the numbers of the engine's bodies.

    A movable body starts asleep and wakes when the robot comes near. Bodies are in maximal
    coordinates, because the engine's usual ones, made for chains of links, cost more.
    """
    group, meets = (GROUND if body.is_ground else FIXED), MOVING
    if body.mass is not None:
        group, meets = MOVABLE, MOVING | GROUND | FIXED
    body_ids = []
    for pose, shapes in split_body(body):
        body_id: int = bullet.createMultiBody(
            body.mass or 0.0,
            create_shape(bullet, shapes),
            _create_look(bullet, shapes),
            pose.position,
            pose.quaternion,
            useMaximalCoordinates=True,
        )
        bullet.setCollisionFilterGroupMask(body_id, -1, group, meets)
        friction = min(body.friction, MAX_FRICTION)
        bullet.changeDynamics(body_id, -1, lateralFriction=friction)
        if body.mass is None and shapes[0].kind == "convex":
            bullet.changeDynamics(body_id, -1, collisionMargin=MARGIN_M)
        body_ids.append(body_id)
    if body.mass is not None:
        _make_movable(bullet, body_id, body)
    return body_ids


def add_walker(bullet: Any, radius: float, height: float) -> int:
    """Add a walker, which only robots meet and only the engine's caller moves."""
    shapes = [Shape("cylinder", (radius, height))]
    body_id: int = bullet.createMultiBody(
        0.0, create_shape(bullet, shapes), _create_look(bullet, shapes), (0, 0, 0), (0, 0, 0, 1)
    )
    bullet.setCollisionFilterGroupMask(body_id, -1, MOVABLE, RAY | ROBOT)
    return body_id


def _create_look(bullet: Any, shapes: Sequence[Shape]) -> int:
    """Return the look, which nobody sees: -1, the contact's, unless files would be read."""
    if len(shapes) == 1 or all(shape.kind != "convex" for shape in shapes):
        return -1
    return int(bullet.createVisualShape(bullet.GEOM_SPHERE, radius=0.01))


def _make_movable(bullet: Any, body_id: int, body: Body) -> None:
    inertia = _inertia(body)
    if inertia is not None:
        bullet.changeDynamics(  # with its mass, which the engine would otherwise set to 0
            body_id, -1, mass=body.mass, localInertiaDiagonal=inertia
        )
    asleep = bullet.ACTIVATION_STATE_ENABLE_SLEEPING | bullet.ACTIVATION_STATE_SLEEP
    bullet.changeDynamics(body_id, -1, activationState=asleep)


def _inertia(body: Body) -> Vector | None:
    """Return the principal moments [kg m2]; None: the engine's, which takes polyhedra for boxes."""
    if body.inertia is None and any(shape.kind == "convex" for shape in body.shapes):
        return joint_moments(body.shapes, body.mass or 0.0)
    return body.inertia


def find_falling(bullet: Any, world: World, movable: dict[int, Body]) -> tuple[int, ...]:
    """The movable bodies, by their numbers, that nothing carries."""
    return tuple(
        body_id
        for body_id, body in movable.items()
        if not (world.is_level and _bottom(body) <= GAP_M) and not _is_carried(bullet, body_id)
    )


def _bottom(body: Body) -> float:
    return min(bottom_height(shape, body.pose @ shape.pose) for shape in body.shapes)


def _is_carried(bullet: Any, body_id: int) -> bool:
    low, high = bullet.getAABB(body_id, -1)
    low = (low[0], low[1], low[2] - GAP_M)
    near = bullet.getOverlappingObjects(low, high) or ()
    return any(
        point[7][2] > UPWARDS  # of the normal, towards this body
        for other in dict.fromkeys(other for other, _ in near)
        if other != body_id
        for point in bullet.getClosestPoints(body_id, other, GAP_M)
    )


def measure_radius(bullet: Any, body_id: int) -> float:
    """Return a radius [m] about its centre of mass within which a body lies, however it turns."""
    low, high = bullet.getAABB(body_id, -1)
    centre, _ = bullet.getBasePositionAndOrientation(body_id)
    middle = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
    return math.dist(middle, centre) + math.dist(low, high) / 2


def wake(bullet: Any, body_id: int) -> None:
    """Let a body move, until it comes to rest."""
    awake = bullet.ACTIVATION_STATE_ENABLE_SLEEPING | bullet.ACTIVATION_STATE_WAKE_UP
    bullet.changeDynamics(body_id, -1, activationState=awake)
