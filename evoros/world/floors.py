"""Floors (fixed bodies with a level top at home's height, made z = 0), and the ground's height."""

import logging
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from evoros.base.arrays import Array, length, product
from evoros.base.errors import InputError
from evoros.formats.strict_xml import list_names
from evoros.geometry import footprint
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.course import Course

_LOG = logging.getLogger(__name__)

GROUND = Body("ground", Pose(), (Shape("plane", (0.0, 0.0, 1.0)),))
MAT_M = 0.015  # maximum height of a level top, such as a mat's, that is part of the floor
STAGE_M = 1.0  # maximum height of a level top that becomes the floor if it carries the course
STEP_M = 0.1  # spacing [m] of sample points on a course, which distinguish floors from posts
_LEVEL = 1e-6
_STEEP = 0.5  # minimum vertical component of a ground plane's unit normal


@dataclass(frozen=True, eq=False)
class _Top:
    body: int
    shape: int
    height: float  # [m]
    area: footprint.Footprint


def ground_height(bodies: Sequence[Body], point: Sequence[float]) -> float | None:
    """Return the height [m] of the highest ground at a point [x, y]; None if there is none."""
    return _find_height([*ground_shapes(bodies)], point)


def _find_height(solids: Sequence[tuple[Shape, Pose]], point: Sequence[float]) -> float | None:
    heights = (_height_at(shape, pose, point) for shape, pose in solids)
    return max((height for height in heights if height is not None), default=None)


def ground_shapes(bodies: Sequence[Body]) -> Iterator[tuple[Shape, Pose]]:
    """Yield the shapes of the ground with poses in the world."""
    for body in bodies:
        if body.is_ground:
            yield from body.placed


def project_ground(bodies: Sequence[Body]) -> list[footprint.Footprint] | None:
    """Return the footprints of the ground; None if it is unbounded."""
    shapes = [*ground_shapes(bodies)]
    endless = any(shape.kind == "plane" for shape, _ in shapes)
    return None if endless else [footprint.project_shape(*solid) for solid in shapes]


def plane_normal(shape: Shape, pose: Pose) -> Array:
    """Return the unit normal (3,) of a plane at ``pose``, in the world frame."""
    return np.asarray(product(pose.rotation, np.array(shape.size)) / length(np.array(shape.size)))


def _is_wall(shape: Shape, pose: Pose) -> bool:
    return shape.kind == "plane" and float(plane_normal(shape, pose)[2]) < _STEEP


def check_planes(bodies: Sequence[Body], source: str) -> None:
    """Check that all planes face up; a steeper plane, such as a wall, is not ground."""
    for body in bodies:
        for shape, pose in body.placed:
            if _is_wall(shape, pose):
                normal = plane_normal(shape, pose).round(6).tolist()
                raise InputError(
                    f"{source}: the ground plane {body.name!r} must face up, not along "
                    f"{normal}; use a box for any other surface"
                )


def drop_walls(bodies: Sequence[Body], source: str) -> tuple[Body, ...]:
    """Leave out planes that do not face up, such as posters; in Gazebo, these are endless walls."""
    kept: list[Body] = []
    left_out: list[str] = []
    for body in bodies:
        walls = [_is_wall(*solid) for solid in body.placed]
        if any(walls):
            left_out.append(body.name)
            rest = tuple(shape for shape, wall in zip(body.shapes, walls, strict=True) if not wall)
            kept += [replace(body, shapes=rest)] if rest else []
        else:
            kept.append(body)
    if left_out:
        _LOG.warning("%s: planes that do not face up are left out (%s); for a wall, use a box",
                     source, list_names(left_out))  # fmt: skip
    return tuple(kept)


def is_level(shape: Shape, pose: Pose) -> bool:
    """Return True if the surface of a ground shape is level."""
    if shape.kind == "plane":
        normal = plane_normal(shape, pose)
        return math.hypot(normal[0], normal[1]) <= _LEVEL
    return shape.kind != "heightfield"


def has_level_ground(bodies: Sequence[Body]) -> bool:
    """Return True if the ground contains no tilted plane or height field."""
    return all(is_level(shape, pose) for shape, pose in ground_shapes(bodies))


def _height_at(shape: Shape, pose: Pose, point: Sequence[float]) -> float | None:
    x, y = point[0] - pose.position[0], point[1] - pose.position[1]
    if shape.kind == "plane":
        normal = plane_normal(shape, pose)
        if normal[2] <= _LEVEL:
            return None
        return float(pose.position[2] - (normal[0] * x + normal[1] * y) / normal[2])
    if shape.kind == "heightfield":
        x, y, _ = pose.inverse().transform((point[0], point[1], 0.0))
        height = interpolate_heights(np.array(shape.heights), shape.size, x, y)
        return None if height is None else pose.position[2] + height
    top = _level_top(shape, pose)
    return top[0] if top is not None and footprint.contains(top[1], point) else None


def interpolate_heights(heights: Array, size: Sequence[float], x: float, y: float) -> float | None:
    """Return the height [m] of a field at a point [m]; None outside the field's ``size`` [m]."""
    rows, columns = heights.shape
    row = (y / size[1] + 0.5) * (rows - 1)
    column = (x / size[0] + 0.5) * (columns - 1)
    if not (0 <= row <= rows - 1 and 0 <= column <= columns - 1):
        return None
    i, j = min(int(row), rows - 2), min(int(column), columns - 2)
    v, u = row - i, column - j
    (a, b), (c, d) = heights[i : i + 2, j : j + 2]
    return float((1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * c + u * d))


@lru_cache(maxsize=2**15)  # enough for the parts of one furnished building
def _level_top(shape: Shape, pose: Pose) -> tuple[float, footprint.Footprint] | None:
    """Return the height [m] and footprint of a solid shape's level top; None if it has none."""
    up = np.abs(pose.rotation[2])
    upright = {"box": up.max(), "cylinder": up[2]}.get(shape.kind, 0.0)
    if upright > 1 - _LEVEL:
        return footprint.top_height(shape, pose), footprint.project_shape(shape, pose)
    if shape.kind == "convex":
        corners = product(shape.points, pose.rotation.T) + pose.position
        height = float(corners[:, 2].max())
        highest = footprint.convex_hull(corners[corners[:, 2] > height - 1e-3, :2])
        return None if len(highest) < 3 else (height, footprint.Footprint(highest))
    return None


def settle(bodies: Sequence[Body], course: Course, source: str) -> tuple[Body, ...]:
    """Mark floors, shift all bodies so that home is at z = 0, and add missing ground."""
    points = [(course.home_x_m, course.home_y_m), *course.waypoints]
    (x0, y0), (x1, y1) = np.min(points, axis=0), np.max(points, axis=0)
    tops = _list_tops(bodies, (x0, y0, -math.inf), (x1, y1, math.inf))
    level = _find_level(bodies, tops, points)
    ends = (-math.inf, -math.inf, level - MAT_M), (math.inf, math.inf, level + MAT_M)
    near = (top for top in _list_tops(bodies, *ends) if abs(top.height - level) <= MAT_M)
    bodies = _mark_floors(bodies, near)
    if abs(level) > _LEVEL:
        _LOG.warning("%s: the floor at home is at z = %g m; moved the world by %g m",
                     source, level, -level)  # fmt: skip
        bodies = [raise_body(body, -level) for body in bodies]
    bare = [point for point in points if ground_height(bodies, point) is None]
    if not bare:
        return tuple(bodies)
    where = "" if len(bare) == len(points) else f" at ({bare[0][0]:g}, {bare[0][1]:g})"
    _LOG.warning("%s: no ground found%s; added level ground", source, where)
    taken = {body.name for body in bodies}
    name = GROUND.name if GROUND.name not in taken else "level ground"
    return (replace(GROUND, name=name), *bodies)


def _list_tops(bodies: Sequence[Body], low: Sequence[float], high: Sequence[float]) -> list[_Top]:
    """List level tops of fixed bodies that reach into the box between two corners [m]."""
    return [
        _Top(i, j, *top)
        for i, body in enumerate(bodies)
        if body.mass is None
        for j in np.flatnonzero(body.reach(low, high)).tolist()
        if (top := _level_top(*body.placed[j])) is not None
    ]


def _find_level(
    bodies: Sequence[Body], tops: Sequence[_Top], points: Sequence[Sequence[float]]
) -> float:
    solids = [*ground_shapes(bodies)]
    ground = _find_height(solids, points[0])
    at_home = sorted(top.height for top in tops if footprint.contains(top.area, points[0]))
    corners = len(points) - 1
    along = np.array([*points[1:], *points_between(points)], dtype=np.float64)
    grounds = [_find_height(solids, point) for point in along.tolist()]

    def carries_all(height: float) -> bool:
        """Return True if floors at this height carry all waypoints and most of the route."""
        carried = np.array([g is not None and abs(g - height) <= MAT_M for g in grounds])
        for top in tops:
            if abs(top.height - height) <= MAT_M:
                carried |= footprint.distances(top.area, along) == 0.0
        return bool(carried[:corners].all() and carried[corners:].sum() * 2 >= len(along) - corners)

    base = ground if ground is not None else min(filter(carries_all, at_home), default=None)
    if base is None:  # no floor supports the whole course, so a low top at home is the floor
        return min((height for height in at_home if abs(height) <= STAGE_M), default=0.0)
    raised = [h for h in at_home if base + MAT_M < h <= base + STAGE_M and carries_all(h)]
    highest = max(raised, default=base)
    return min((h for h in raised if h >= highest - MAT_M), default=base)


def points_between(points: Sequence[Sequence[float]]) -> Iterator[tuple[float, float]]:
    """Yield points [m] on the lines from home through the waypoints and back."""
    for (ax, ay), (bx, by) in zip(points, [*points[1:], points[0]], strict=True):
        count = min(int(math.dist((ax, ay), (bx, by)) / STEP_M), 1000)
        for i in range(1, count):
            share = i / count
            yield ax + share * (bx - ax), ay + share * (by - ay)


def _mark_floors(bodies: Sequence[Body], tops: Iterable[_Top]) -> list[Body]:
    chosen: dict[int, set[int]] = {}
    for top in tops:
        chosen.setdefault(top.body, set()).add(top.shape)
    marked: list[Body] = []
    for i, body in enumerate(bodies):
        floor = tuple(shape for j, shape in enumerate(body.shapes) if j in chosen.get(i, ()))
        rest = tuple(shape for j, shape in enumerate(body.shapes) if j not in chosen.get(i, ()))
        if floor and rest:
            marked.append(replace(body, shapes=rest))
            marked.append(replace(body, name=f"{body.name}::floor", shapes=floor, floor=True))
        else:
            marked.append(replace(body, floor=True) if floor else body)
    return marked


def raise_body(body: Body, height: float) -> Body:
    """Return a body raised by a height [m]."""
    if height == 0.0:
        return body
    x, y, z = body.pose.position
    return replace(body, pose=Pose((x, y, z + height), body.pose.quaternion))
