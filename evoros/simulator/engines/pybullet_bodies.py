"""Bodies and shapes in PyBullet: their collision groups, and how a client creates them."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from evoros.geometry.shapes import Body, Shape

# Collision groups. The engine casts rays in group 1, so no body is in that group. Wheels and
# casters meet the ground only, the robot never meets itself, and fixed bodies never meet each
# other: such pairs cost time wherever walls touch each other or the ground.
RAY, ROBOT, GROUND, FIXED, MOVABLE = 1, 2, 4, 8, 16
VISIBLE = GROUND | FIXED | MOVABLE
MOVING = RAY | ROBOT | MOVABLE

Frame = tuple[tuple[float, ...], tuple[float, ...]]  # position [m], quaternion (x, y, z, w)


def create_shape(bullet: Any, client: int, shapes: Sequence[Shape]) -> int:
    """Create one collision shape, compound if a body has several; returns its number."""
    arguments = [_shape_arguments(bullet, shape) for shape in shapes]
    if len(arguments) == 1 and shapes[0].kind == "plane":
        return int(
            bullet.createCollisionShape(
                bullet.GEOM_PLANE, planeNormal=shapes[0].size, physicsClientId=client
            )
        )
    columns = {key: [shape[key] for shape in arguments] for key in arguments[0]}
    return int(bullet.createCollisionShapeArray(**columns, physicsClientId=client))


def _shape_arguments(bullet: Any, shape: Shape) -> dict[str, Any]:
    size = shape.size
    kinds = {
        "box": bullet.GEOM_BOX,
        "cylinder": bullet.GEOM_CYLINDER,
        "sphere": bullet.GEOM_SPHERE,
        "plane": bullet.GEOM_PLANE,
    }
    return {
        "shapeTypes": kinds[shape.kind],
        "halfExtents": [edge / 2 for edge in size] if shape.kind == "box" else [0, 0, 0],
        "radii": size[0] if shape.kind in ("sphere", "cylinder") else 0.0,
        "lengths": size[1] if shape.kind == "cylinder" else 0.0,
        "planeNormals": size if shape.kind == "plane" else [0, 0, 1],
        "collisionFramePositions": shape.pose.position,
        "collisionFrameOrientations": shape.pose.quaternion,
    }


def add_body(bullet: Any, client: int, body: Body) -> int:
    """Add one body of the world; returns its number.

    A movable body starts asleep and wakes when the robot comes near. Bodies are in maximal
    coordinates, because the engine's usual ones, made for chains of links, cost more.
    """
    number: int = bullet.createMultiBody(
        body.mass or 0.0,
        create_shape(bullet, client, body.shapes),
        -1,
        body.pose.position,
        body.pose.quaternion,
        useMaximalCoordinates=True,
        physicsClientId=client,
    )
    group, meets = (GROUND if body.is_ground else FIXED), MOVING
    if body.mass is not None:
        group, meets = MOVABLE, MOVING | GROUND | FIXED
    bullet.setCollisionFilterGroupMask(number, -1, group, meets, physicsClientId=client)
    bullet.changeDynamics(number, -1, lateralFriction=body.friction, physicsClientId=client)
    if body.mass is not None:
        _make_movable(bullet, client, number, body)
    return number


def _make_movable(bullet: Any, client: int, number: int, body: Body) -> None:
    if body.inertia is not None:
        bullet.changeDynamics(  # with its mass, which the engine would otherwise set to 0
            number,
            -1,
            mass=body.mass,
            localInertiaDiagonal=body.inertia,
            physicsClientId=client,
        )
    asleep = bullet.ACTIVATION_STATE_ENABLE_SLEEPING | bullet.ACTIVATION_STATE_SLEEP
    bullet.changeDynamics(number, -1, activationState=asleep, physicsClientId=client)


def load_urdf(bullet: Any, client: int, urdf: str, frame: Frame, flags: int) -> int:
    """Load a robot at a frame; returns its number. PyBullet reads URDF from files only."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(urdf)
        return int(bullet.loadURDF(str(path), *frame, flags=flags, physicsClientId=client))
