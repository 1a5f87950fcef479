"""The bodies of a world in MuJoCo, and the pairs of bodies that can collide."""

from collections.abc import Iterable
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from evoros.base.arrays import length
from evoros.geometry.polyhedron import convex_polyhedron, joint_moments
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.simulator.engines.teams import MAX_FRICTION
from evoros.world.model import World

# groups of shapes in the engine, which determine what rays detect
GROUND, FIXED, MOVABLE, ROBOT, HIDDEN = range(5)
VISIBLE = np.array([1, 1, 1, 0, 0, 0], dtype=np.uint8)

# Two shapes can collide if the type bits (contype) of one overlap the other's collision bits
# (conaffinity). Contacts with the ground are explicit pairs, because only a pair can have a
# separate friction coefficient. The ground still has collision bits, for a type that no shape has,
# because rays can miss a fixed shape that collides with nothing.
MEETS: dict[int, tuple[int, int]] = {GROUND: (0, 4), FIXED: (0, 3), MOVABLE: (2, 3), ROBOT: (1, 0)}
"""(contype, conaffinity) of each group."""
MEETS_ROBOTS = (0, 1)  # contype and conaffinity of the walkers
ROBOT_BIT = 8  # type bit of the first of several robots; each further robot has the next bit

BELOW_M = 1.0  # depth [m] of solid below the lowest point of a height field

CENTRED: dict[str, Any] = {"ipos": [0, 0, 0], "iquat": [1, 0, 0, 0], "explicitinertial": True}
"""Inertia in the frame of the body; otherwise, the engine would add the body's position twice."""


SLIDING = (0.1, 1.0)
"""Time constant [s] and damping ratio of friction on sliding bodies, which lifts them inversely.
With two steps, as for rolling wheels, a box pushed at 0.3 m/s would hover by 12 mm, or hop.
"""


class Sole(NamedTuple):
    """A shape that touches the ground."""

    shape: str
    friction: float  # factor of the ground's friction coefficient; 0 is frictionless
    rolls: bool = False


def add_bodies(spec: Any, library: Any, world: World) -> list[Sole]:
    """Add the bodies of a world; return the shapes that can touch the ground."""
    soles = []
    for index, body in enumerate(world.bodies):
        friction = min(body.friction, MAX_FRICTION)
        if body.mass is None:
            group = GROUND if body.is_ground else FIXED
            posed = ((pose, shape) for shape, pose in body.placed)
            names = add_shapes(spec, library, spec.worldbody, f"world {index}", group, posed)
        else:
            placed = _add_movable(spec, body)
            posed = ((shape.pose, shape) for shape in body.shapes)
            names = add_shapes(spec, library, placed, f"world {index}", MOVABLE, posed)
            soles += [Sole(name, friction) for name in names]
        for name in names:
            spec.geom(name).friction = [friction, 0.0, 0.0]
    return soles


def add_walkers(spec: Any, library: Any, sizes: Iterable[tuple[float, float]]) -> None:
    """Add a walker per (radius, height) [m]; the caller moves the walkers."""
    for index, (radius, height) in enumerate(sizes):
        walker = spec.worldbody.add_body(name=name_walker(index), mocap=True)
        posed = [(Pose(), Shape("cylinder", (radius, height)))]
        (name,) = add_shapes(spec, library, walker, name_walker(index), MOVABLE, posed)
        spec.geom(name).contype, spec.geom(name).conaffinity = MEETS_ROBOTS


def name_walker(index: int) -> str:
    """Return the name of a walker in the engine."""
    return f"walker {index}"


def _add_movable(spec: Any, body: Body) -> Any:
    placed = spec.worldbody.add_body(
        pos=body.pose.position,
        quat=scalar_first(body.pose),
        mass=body.mass,
        inertia=body.inertia or joint_moments(body.shapes, body.mass or 0.0),
        **CENTRED,
    )
    placed.add_freejoint()
    return placed


def add_shapes(
    spec: Any, library: Any, owner: Any, name: str, group: int, posed: Iterable[tuple[Pose, Shape]]
) -> list[str]:
    """Add shapes to a body of the engine; return their names."""
    names = []
    for index, (pose, shape) in enumerate(posed):
        names.append(f"{name}.{index}")
        types, meets = MEETS[group]
        owner.add_geom(
            name=names[-1],
            group=group,
            contype=types,
            conaffinity=meets,
            **_shape_arguments(spec, library, names[-1], pose, shape),
        )
    return names


def _shape_arguments(
    spec: Any, library: Any, name: str, pose: Pose, shape: Shape
) -> dict[str, Any]:
    kinds = library.mjtGeom
    size: list[float] = [0.0, 0.0, 0.0]
    values: dict[str, Any] = {}
    if shape.kind == "box":
        kind, size = kinds.mjGEOM_BOX, [edge / 2 for edge in shape.size]
    elif shape.kind == "sphere":
        kind, size = kinds.mjGEOM_SPHERE, [shape.size[0], 0.0, 0.0]
    elif shape.kind == "cylinder":
        kind, size = kinds.mjGEOM_CYLINDER, [shape.size[0], shape.size[1] / 2, 0.0]
    elif shape.kind == "plane":
        kind, size = kinds.mjGEOM_PLANE, [0.0, 0.0, 1.0]
        pose = pose @ _upright(shape)
    elif shape.kind == "convex":
        kind = kinds.mjGEOM_MESH
        values["meshname"] = _add_polyhedron(spec, library, name, shape)
    else:
        kind = kinds.mjGEOM_HFIELD
        values["hfieldname"] = _add_field(spec, name, shape)
        pose = pose @ Pose((0.0, 0.0, min(map(min, shape.heights))))
    return {"type": kind, "size": size, "pos": pose.position, "quat": scalar_first(pose), **values}


def _upright(plane: Shape) -> Pose:
    normal = np.array(plane.size) / length(np.array(plane.size))
    x = np.cross(np.eye(3)[int(np.abs(normal).argmin())], normal)
    x /= length(x)
    rotation = np.column_stack([x, np.cross(normal, x), normal])
    return Pose.from_matrix((0.0, 0.0, 0.0), rotation)


def _add_polyhedron(spec: Any, library: Any, name: str, shape: Shape) -> str:
    solid = convex_polyhedron(shape.corners)
    spec.add_mesh(
        name=name,
        uservert=solid.corners.ravel(),
        userface=solid.triangles.ravel().astype(np.int32),
        inertia=library.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
    )
    return name


def _add_field(spec: Any, name: str, shape: Shape) -> str:
    """Add a height field; its heights are normalized to 0..1, which the engine scales to metres."""
    heights = np.array(shape.heights)
    rows, columns = heights.shape
    extent = max(float(np.ptp(heights)), 1e-9)
    x, y = shape.size
    spec.add_hfield(
        name=name,
        nrow=rows,
        ncol=columns,
        size=[x / 2, y / 2, extent, BELOW_M],
        userdata=((heights - heights.min()) / extent).ravel(),
    )
    return name


def add_ground_pairs(
    spec: Any, soles: Iterable[Sole], slides: dict[str, Any], rolls: dict[str, Any]
) -> None:
    """Let shapes collide with the ground; sliding and rolling shapes differ in parameters.

    Friction is the product of both coefficients, as in PyBullet; the larger would give ice grip.
    """
    grounds = [geom for geom in spec.geoms if geom.group == GROUND]
    for sole, ground in product(soles, grounds):
        friction = sole.friction * float(ground.friction[0])
        spec.add_pair(
            geomname1=sole.shape,
            geomname2=ground.name,
            condim=3 if friction else 1,
            friction=[max(friction, 1e-5)] * 2 + [0.0, 0.0, 0.0],
            **(rolls if sole.rolls else slides),
        )


def scalar_first(pose: Pose) -> list[float]:
    """Return the quaternion of a pose as w, x, y, z, the engine's order."""
    x, y, z, w = pose.quaternion
    return [w, x, y, z]
