"""The bodies of a world in PyBullet; compounds with polyhedra require temporary files."""

import math
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from evoros.geometry.footprint import lowest_point
from evoros.geometry.polyhedron import convex_polyhedron, joint_moments
from evoros.geometry.shapes import Body, Pose, Shape, Vector
from evoros.simulator.engines.teams import MAX_FRICTION, Frame
from evoros.world.model import World
from evoros.world.standing import GAP_M


def split_body(body: Body) -> Iterator[tuple[Pose, tuple[Shape, ...]]]:
    """Yield the world pose and the shapes of each engine body that represents a world body.

    Polyhedra of fixed bodies, which then need no file, and height fields, whose origin the engine
    puts at their middle height, become separate bodies.
    """
    kinds = {shape.kind for shape in body.shapes}
    if body.mass is not None or not kinds & {"convex", "heightfield"}:
        yield body.pose, body.shapes
        return
    for shape, pose in body.placed:
        if shape.kind == "heightfield":
            heights = np.array(shape.heights)
            pose = pose @ Pose((0.0, 0.0, float(heights.min() + heights.max()) / 2))
        yield pose, (replace(shape, pose=Pose()),)


def create_shape(bullet: Any, shapes: Sequence[Shape]) -> int:
    """Create a collision shape, a compound for several shapes; return its id."""
    if len(shapes) == 1 and shapes[0].kind in ("plane", "convex", "heightfield"):
        return _create_single(bullet, shapes[0])
    with tempfile.TemporaryDirectory() as folder:
        arguments = [_shape_arguments(bullet, shape) for shape in shapes]
        if any(shape.kind == "convex" for shape in shapes):
            files = _write_polyhedra(Path(folder), shapes)
            arguments = [
                {**values, "fileNames": file, "meshScales": [1, 1, 1]}
                for values, file in zip(arguments, files, strict=True)
            ]
        columns = {key: [shape[key] for shape in arguments] for key in arguments[0]}
        return int(bullet.createCollisionShapeArray(**columns))


def _create_single(bullet: Any, shape: Shape) -> int:
    if shape.kind == "plane":
        shape_id = bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=shape.size)
    elif shape.kind == "convex":
        shape_id = bullet.createCollisionShape(
            bullet.GEOM_MESH,
            vertices=convex_polyhedron(shape.corners).corners.tolist(),
            collisionFramePosition=shape.pose.position,
            collisionFrameOrientation=shape.pose.quaternion,
        )
    else:
        heights = np.array(shape.heights)
        rows, columns = heights.shape
        shape_id = bullet.createCollisionShape(
            bullet.GEOM_HEIGHTFIELD,
            meshScale=[shape.size[0] / (columns - 1), shape.size[1] / (rows - 1), 1.0],
            heightfieldData=heights.ravel().tolist(),
            numHeightfieldRows=columns,  # the grid of the engine is column-major
            numHeightfieldColumns=rows,
        )
    return int(shape_id)


def _shape_arguments(bullet: Any, shape: Shape) -> dict[str, Any]:
    size = shape.size
    kind = "mesh" if shape.kind == "convex" else shape.kind
    return {
        "shapeTypes": getattr(bullet, f"GEOM_{kind.upper()}"),
        "halfExtents": [edge / 2 for edge in size] if shape.kind == "box" else [0, 0, 0],
        "radii": size[0] if shape.kind in ("sphere", "cylinder") else 0.0,
        "lengths": size[1] if shape.kind == "cylinder" else 0.0,
        "planeNormals": size if shape.kind == "plane" else [0, 0, 1],
        "collisionFramePositions": shape.pose.position,
        "collisionFrameOrientations": shape.pose.quaternion,
    }


def _write_polyhedra(folder: Path, shapes: Sequence[Shape]) -> list[str]:
    paths = []
    for index, shape in enumerate(shapes):
        path = folder / f"{index}.obj"
        if shape.kind == "convex":
            path.write_text(_format_obj(shape.corners), encoding="utf-8")
        paths.append(str(path) if shape.kind == "convex" else "")
    return paths


def _format_obj(corners: tuple[Vector, ...]) -> str:
    solid = convex_polyhedron(corners)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in solid.corners.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (solid.triangles + 1).tolist()]
    return "\n".join(lines) + "\n"


def load_urdf(bullet: Any, urdf: str, frame: Frame, flags: int) -> int:
    """Load a robot at a frame and return its body id; PyBullet reads URDF only from files."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(_format_urdf(urdf, Path(folder)), encoding="utf-8")
        return int(bullet.loadURDF(str(path), *frame, flags=flags))


def _format_urdf(urdf: str, folder: Path) -> str:
    """Return a URDF with ``<convex>`` as files in ``folder`` and lines below 8,191 characters."""
    root = etree.fromstring(urdf.encode())
    for index, element in enumerate(root.iter("convex")):
        numbers = iter([float(word) for word in str(element.get("corners")).split()])
        corners, path = tuple(zip(numbers, numbers, numbers, strict=True)), folder / f"{index}.obj"
        path.write_text(_format_obj(corners), encoding="utf-8")
        element.tag = "mesh"
        del element.attrib["corners"]
        element.set("filename", str(path))
    etree.indent(root, space="")
    return etree.tostring(root, encoding="unicode")


# Collision groups. The engine casts rays in group 1, so no body is in this group. Wheels and
# casters covered by the chassis collide only with the ground. A robot never collides with itself.
# Fixed bodies never collide with each other, because checking such pairs costs time wherever walls
# touch.
RAY, ROBOT, GROUND, FIXED, MOVABLE = 1, 2, 4, 8, 16
VISIBLE = GROUND | FIXED | MOVABLE
MOVING = RAY | ROBOT | MOVABLE
ROBOT_BIT = 32  # group of the first of several robots, which collide; further bits follow

MARGIN_M = 1e-4  # collision margin [m] of polyhedra; rays miss if it is less, hit early if more
UPWARDS = 0.1  # minimum upward component of the contact normal for a supporting contact


def add_body(bullet: Any, body: Body) -> list[int]:
    """Add a body of the world, asleep if movable; return the ids of the engine bodies."""
    # Maximal coordinates are faster than reduced coordinates, the default.
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
    """Add a walker, which collides only with robots and is moved by the caller; return its id."""
    shapes = [Shape("cylinder", (radius, height))]
    body_id: int = bullet.createMultiBody(
        0.0, create_shape(bullet, shapes), _create_look(bullet, shapes), (0, 0, 0), (0, 0, 0, 1)
    )
    bullet.setCollisionFilterGroupMask(body_id, -1, MOVABLE, RAY | ROBOT)
    return body_id


def _create_look(bullet: Any, shapes: Sequence[Shape]) -> int:
    """Return the id of a tiny visual shape if the default (the collision shape) requires files."""
    if len(shapes) == 1 or all(shape.kind != "convex" for shape in shapes):
        return -1
    return int(bullet.createVisualShape(bullet.GEOM_SPHERE, radius=0.01))


def _make_movable(bullet: Any, body_id: int, body: Body) -> None:
    inertia = body.inertia  # None: computed by the engine, which treats polyhedra as boxes
    if inertia is None and any(shape.kind == "convex" for shape in body.shapes):
        inertia = joint_moments(body.shapes, body.mass or 0.0)
    if inertia is not None:
        bullet.changeDynamics(  # otherwise, the engine would set the mass to 0
            body_id, -1, mass=body.mass, localInertiaDiagonal=inertia
        )
    asleep = bullet.ACTIVATION_STATE_ENABLE_SLEEPING | bullet.ACTIVATION_STATE_SLEEP
    bullet.changeDynamics(body_id, -1, activationState=asleep)


def find_falling(bullet: Any, world: World, movable: dict[int, Body]) -> tuple[int, ...]:
    """Return the ids of movable bodies without support."""
    return tuple(
        body_id
        for body_id, body in movable.items()
        if not (world.is_level and lowest_point(body) <= GAP_M) and not _is_carried(bullet, body_id)
    )


def _is_carried(bullet: Any, body_id: int) -> bool:
    low, high = bullet.getAABB(body_id, -1)
    low = (low[0], low[1], low[2] - GAP_M)
    near = bullet.getOverlappingObjects(low, high) or ()
    return any(
        point[7][2] > UPWARDS  # contact normal, towards this body
        for other in dict.fromkeys(other for other, _ in near)
        if other != body_id
        for point in bullet.getClosestPoints(body_id, other, GAP_M)
    )


def measure_radius(bullet: Any, body_id: int) -> float:
    """Return the radius [m] of a sphere about the centre of mass that contains a body."""
    low, high = bullet.getAABB(body_id, -1)
    centre, _ = bullet.getBasePositionAndOrientation(body_id)
    middle = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
    return math.dist(middle, centre) + math.dist(low, high) / 2


def wake(bullet: Any, body_id: int) -> None:
    """Wake a body, which sleeps again when it comes to rest."""
    awake = bullet.ACTIVATION_STATE_ENABLE_SLEEPING | bullet.ACTIVATION_STATE_WAKE_UP
    bullet.changeDynamics(body_id, -1, activationState=awake)
