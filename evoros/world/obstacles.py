"""The obstacles of a world as arrays, for contact and for ray casting."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from evoros.base.arrays import Array
from evoros.geometry.footprint import Footprint, bounding_circle, project_bodies, project_shape
from evoros.geometry.grid import Grid
from evoros.geometry.outlines import Outlines
from evoros.geometry.polyhedron import convex_polyhedron
from evoros.geometry.ray import BOX, CONVEX, CYLINDER, FACE_SIZE, OBSTACLE_SIZE, SPHERE
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.model import KEPT_WORLDS, World
from evoros.world.standing import standing_obstacles


@lru_cache(maxsize=KEPT_WORLDS)
def outlines(world: World, below_m: float) -> Outlines:
    """Return the footprints of all solid shapes whose lowest point is below a height [m]."""
    return Outlines.of(project_bodies(standing_obstacles(world), below_m))


@lru_cache(maxsize=64)  # of up to 7 MB each, for a lidar that sees all of a field
def world_arrays(world: World, height: float, touch: float, see: float) -> tuple[Array, ...]:
    """Return ``obstacle_arrays`` of all obstacles of a world."""
    return obstacle_arrays(standing_obstacles(world), height, touch, see)


def obstacle_arrays(
    bodies: Sequence[Body], height: float, touch: float, see: float
) -> tuple[Array, ...]:
    """Return obstacles for a robot of some height [m].

    ``touch`` and ``see`` [m] are the distances from the origin of its frame up to which the robot
    can touch and see.

    Returns:
        The grid (see ``evoros.geometry.grid``); for contact, the starts and entries of its cells,
        and the rows and corners of ``outlines``; for rays (see ``evoros.geometry.ray``), the starts
        and entries of its cells, the rows of all obstacles, and the faces of their polyhedra.
    """
    solids = [
        (shape, body.pose @ shape.pose)
        for body in bodies
        for shape in body.shapes
        if shape.kind != "plane"
    ]
    rows, faces, visible = sight_rows(solids)
    touchable = project_bodies(bodies, height)
    areas = Outlines.of(touchable)
    grid = Grid.around(visible, max(touch, see))
    return (
        grid.to_array(),
        *grid.list_near(touchable, touch),
        areas.rows,
        areas.corners,
        *grid.list_near(visible, see),
        rows,
        faces,
    )


def sight_rows(solids: Sequence[tuple[Shape, Pose]]) -> tuple[Array, Array, list[Footprint]]:
    """Return shapes for rays, the faces of their polyhedra, and the shapes' footprints."""
    placed = [_centre(shape, pose) for shape, pose in solids]
    areas = [project_shape(shape, pose) for shape, pose in placed]
    faces = [
        convex_polyhedron(shape.corners).faces
        if shape.kind == "convex"
        else np.zeros((0, FACE_SIZE))
        for shape, _ in placed
    ]
    ends = np.cumsum([len(rows) for rows in faces], dtype=np.int64).tolist()
    rows = [
        _to_row(*solid, area, (end - len(part), end))
        for solid, area, part, end in zip(placed, areas, faces, ends, strict=True)
    ]
    array = np.array(rows).reshape(-1, OBSTACLE_SIZE)
    return array, np.concatenate([np.zeros((0, FACE_SIZE)), *faces]), areas


def _centre(shape: Shape, pose: Pose) -> tuple[Shape, Pose]:
    """Move the origin of a polyhedron to its middle, because rays are bounded around the origin."""
    if shape.kind != "convex":
        return shape, pose
    corners = np.array(shape.corners)
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    moved = tuple((x, y, z) for x, y, z in (corners - middle).tolist())
    x, y, z = middle.tolist()
    return replace(shape, corners=moved), pose @ Pose((x, y, z))


def _to_row(shape: Shape, pose: Pose, footprint: Footprint, faces: tuple[int, int]) -> list[float]:
    kinds = {"box": BOX, "cylinder": CYLINDER, "sphere": SPHERE, "convex": CONVEX}
    x, y, radius = bounding_circle(footprint)
    # Rays need a circle around the centre of the shape, which may lie beside the footprint's.
    offset = math.dist((x, y), pose.position[:2])
    return [
        kinds[shape.kind],
        *pose.position,
        radius + offset,
        *pose.rotation.ravel().tolist(),
        *_extent(shape, faces),
    ]


def _extent(shape: Shape, faces: tuple[int, int]) -> list[float]:
    if shape.kind == "convex":
        return [*faces, 0.0]
    if shape.kind == "box":
        return [edge / 2 for edge in shape.size]
    if shape.kind == "cylinder":
        return [shape.size[0], shape.size[1] / 2, 0.0]
    return [shape.size[0], 0.0, 0.0]
