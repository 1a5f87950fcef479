"""Obstacles after movable bodies have fallen, for code that simulates no gravity, and as arrays."""

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import chain, compress
from typing import NamedTuple

import numpy as np

from evoros.base.arrays import Array
from evoros.geometry.footprint import (
    Footprint,
    Outlines,
    bounding_circle,
    find_heights,
    lowest_point,
    project_bodies,
    project_shape,
)
from evoros.geometry.grid import Grid
from evoros.geometry.polygon import polygon_distance
from evoros.geometry.polyhedron import convex_polyhedron
from evoros.geometry.ray import BOX, CONVEX, CYLINDER, FACE_SIZE, OBSTACLE_SIZE, SPHERE
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.floors import ground_height, has_level_ground, raise_body
from evoros.world.model import KEPT_WORLDS, World

GAP_M = 0.002  # maximum gap [m] below a movable body that stands
_INNER = 0.99  # scale of a footprint in the test for overlap, so that touching sides are no support


class Part(NamedTuple):
    """A shape of a body, placed in the world."""

    shape: Shape
    pose: Pose
    area: Footprint  # footprint of the portion below a height, if one is given
    bottom: float  # [m]
    top: float  # [m]


@lru_cache(maxsize=KEPT_WORLDS)
def standing_obstacles(world: World) -> tuple[Body, ...]:
    """Return the obstacles of a world after movable bodies have fallen; see ``stand``."""
    return stand(world.bodies)


def stand(all_bodies: Sequence[Body]) -> tuple[Body, ...]:
    """Return the obstacles, with movable bodies moved straight down onto their supports.

    A body that overlaps another stays; on uneven ground, obstacles are lowered by its height.
    """
    bodies = [body for body in all_bodies if not body.is_ground]
    floor = [body for body in all_bodies if body.is_ground]
    grounds = [0.0] * len(bodies)
    if not has_level_ground(all_bodies):
        grounds = [ground_height(floor, body.pose.position[:2]) or 0.0 for body in bodies]
    lowest = {i: lowest_point(body) for i, body in enumerate(bodies) if body.mass is not None}
    falling = {i for i, bottom in lowest.items() if bottom - grounds[i] > GAP_M}
    if falling:
        settled = _Settled(_list_below(bodies, falling))
        for i in sorted(falling, key=lowest.__getitem__):
            bodies[i] = raise_body(bodies[i], -settled.drop(place_parts(bodies[i]), grounds[i]))
            settled.add(place_parts(bodies[i]))
    return tuple(raise_body(body, -ground) for body, ground in zip(bodies, grounds, strict=True))


def _list_below(bodies: Sequence[Body], falling: Collection[int]) -> list[Part]:
    """List the parts of bodies that do not fall, and onto which others can fall."""
    still = [body for i, body in enumerate(bodies) if i not in falling]
    boxes = np.concatenate([np.empty((0, 2, 3)), *(body.boxes for body in still)])[:, :, :2]
    near = np.zeros(len(boxes), dtype=np.bool_)
    for i in falling:
        low, high = bodies[i].boxes[:, 0, :2].min(axis=0), bodies[i].boxes[:, 1, :2].max(axis=0)
        near |= ((boxes[:, 0] <= high) & (boxes[:, 1] >= low)).all(axis=1)
    solids = chain.from_iterable(body.placed for body in still)
    return [_place_part(*solid, -math.inf) for solid in compress(solids, near)]


def _place_part(shape: Shape, pose: Pose, height_m: float) -> Part:
    bottom, top = find_heights(shape, pose)
    low = bottom < height_m and top > 0.0
    area = project_shape(shape, pose, 0.0, height_m) if low else project_shape(shape, pose)
    return Part(shape, pose, area, bottom, top)


def place_parts(body: Body, height_m: float = -math.inf) -> tuple[Part, ...]:
    """Place the shapes of a body, with footprints of the portions below a height [m]."""
    return tuple(_place_part(*solid, height_m) for solid in body.placed)


class _Settled:
    """Parts that do not fall, with bounding circles of their footprints."""

    def __init__(self, parts: Sequence[Part]) -> None:
        self._parts: list[Part] = []
        self._circles = np.zeros((0, 3))  # x, y and radius [m]
        self.add(parts)

    def add(self, parts: Sequence[Part]) -> None:
        self._parts += parts
        circles = np.array([bounding_circle(part.area) for part in parts]).reshape(-1, 3)
        self._circles = np.concatenate([self._circles, circles])

    def drop(self, shapes: Sequence[Part], ground: float) -> float:
        """Return the distance [m] by which a body with these shapes falls."""
        gaps = [min(shape.bottom for shape in shapes) - ground]
        for shape in shapes:
            for below in self._overlapping(shape):
                if below.top <= shape.bottom:
                    gaps.append(shape.bottom - below.top)
                elif below.bottom < shape.bottom:
                    return 0.0
        drop = min(gaps)
        return drop if drop > GAP_M else 0.0

    def _overlapping(self, shape: Part) -> Iterator[Part]:
        x, y, reach = bounding_circle(shape.area)
        inner = (shape.area.vertices - (x, y)) * _INNER + (x, y)
        dx, dy, near = (self._circles - (x, y, -reach)).T
        for i in np.flatnonzero(dx * dx + dy * dy < near * near).tolist():
            area = self._parts[i].area
            radius = shape.area.radius * _INNER + area.radius
            if polygon_distance(inner, area.vertices, radius) <= radius:
                yield self._parts[i]


@lru_cache(maxsize=8)
def list_areas(world: World, below_m: float) -> tuple[tuple[Body, tuple[Footprint, ...]], ...]:
    """List the obstacles that extend below a height [m], with the footprints of that portion."""
    placed = ((body, project_bodies([body], below_m)) for body in standing_obstacles(world))
    return tuple((body, areas) for body, areas in placed if areas)


def join_areas(world: World, below_m: float) -> list[Footprint]:
    """Return the footprints of all solid shapes that extend below a height [m]."""
    return [area for _, areas in list_areas(world, below_m) for area in areas]


@lru_cache(maxsize=KEPT_WORLDS)
def outlines(world: World, below_m: float) -> Outlines:
    """Return the result of ``join_areas`` as arrays."""
    return Outlines.of(join_areas(world, below_m))


@lru_cache(maxsize=64)  # up to 7 MB per entry if a lidar detects a whole field
def world_arrays(world: World, height: float, touch: float, see: float) -> tuple[Array, ...]:
    """Return the ``obstacle_arrays`` for all obstacles of a world."""
    return obstacle_arrays(standing_obstacles(world), height, touch, see)


def obstacle_arrays(
    bodies: Sequence[Body], height: float, touch: float, see: float
) -> tuple[Array, ...]:
    """Return the arrays of obstacles for a robot of this height [m].

    It touches obstacles within ``touch`` [m] of its origin, and sees them within ``see`` [m]. In
    order: the grid; for contact, the starts and entries of its cells, rows and corners of
    ``outlines``; for rays (``evoros.geometry.ray``), the starts and entries, the rows and the
    faces.
    """
    solids = [solid for body in bodies for solid in body.placed if solid[0].kind != "plane"]
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
    """Return the rows of shapes for ray casting, the faces of polyhedra, and the footprints."""
    placed = [_centre(shape, pose) for shape, pose in solids]
    areas = [project_shape(shape, pose) for shape, pose in placed]
    none = np.zeros((0, FACE_SIZE))
    faces = [
        convex_polyhedron(shape.corners).faces if shape.kind == "convex" else none
        for shape, _ in placed
    ]
    ends = np.cumsum([len(rows) for rows in faces], dtype=np.int64).tolist()
    rows = [
        _to_row(*solid, area, (end - len(part), end))
        for solid, area, part, end in zip(placed, areas, faces, ends, strict=True)
    ]
    array = np.array(rows).reshape(-1, OBSTACLE_SIZE)
    return array, np.concatenate([none, *faces]), areas


def _centre(shape: Shape, pose: Pose) -> tuple[Shape, Pose]:
    """Move the origin of a polyhedron to the centre of the bounding circle used for rays."""
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
    # Rays use a circle about the centre of the shape, which may differ from the footprint's.
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
