"""Obstacles as they stand once movable bodies in the air have fallen, for all that sees from above.

An engine of rigid bodies lets them fall. The plane, where nothing falls, and the measures of
clearance and pictures, which know no height of the ground, take them from here.
"""

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple

from evoros.geometry.footprint import (
    Footprint,
    bottom_height,
    bounding_circle,
    project_shape,
    top_height,
)
from evoros.geometry.polygon import polygon_distance
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.floors import ground_height, has_level_ground, raise_body
from evoros.world.model import KEPT_WORLDS, World

GAP_M = 0.002
"""A movable body with nothing this near below it is in the air."""

_INNER = 0.99
"""Share of a footprint that must lie above another: bodies side by side do not carry each other."""


class Part(NamedTuple):
    """A shape of a body at its place in the world."""

    shape: Shape
    pose: Pose
    area: Footprint  # of its part below a height, if it reaches below
    bottom: float  # [m]
    top: float  # [m]


@lru_cache(maxsize=KEPT_WORLDS)
def standing_obstacles(world: World) -> tuple[Body, ...]:
    """Return the obstacles of a world as they stand, see ``stand``."""
    return stand(world.bodies)


def stand(all_bodies: Sequence[Body]) -> tuple[Body, ...]:
    """Return the obstacles with each movable body set straight down onto what is below it.

    That is the ground, or the highest shape below its footprint. A body into which another one
    reaches stays where it is. Where the ground is not level, each obstacle is lowered by the height
    of the ground below it.
    """
    bodies = [body for body in all_bodies if not body.is_ground]
    floor = [body for body in all_bodies if body.is_ground]
    is_level = has_level_ground(all_bodies)
    grounds = [
        0.0 if is_level else ground_height(floor, body.pose.position[:2]) or 0.0 for body in bodies
    ]
    lowest = [min(bottom_height(s, body.pose @ s.pose) for s in body.shapes) for body in bodies]
    falls = [
        body.mass is not None and bottom - ground > GAP_M
        for body, bottom, ground in zip(bodies, lowest, grounds, strict=True)
    ]
    if any(falls):
        settled = [p for body, fall in zip(bodies, falls, strict=True) if not fall
                   for p in place_parts(body)]  # fmt: skip
        for i in sorted(range(len(bodies)), key=lowest.__getitem__):
            if falls[i]:
                bodies[i] = raise_body(
                    bodies[i], -_drop(place_parts(bodies[i]), settled, grounds[i])
                )
                settled += place_parts(bodies[i])
    return tuple(raise_body(body, -ground) for body, ground in zip(bodies, grounds, strict=True))


def place_parts(body: Body, height_m: float = -math.inf) -> tuple[Part, ...]:
    """Place the shapes of a body, with the areas of parts below a height [m] above the ground."""
    parts = []
    for shape in body.shapes:
        pose = body.pose @ shape.pose
        bottom, top = bottom_height(shape, pose), top_height(shape, pose)
        low = bottom < height_m and top > 0.0
        area = project_shape(shape, pose, 0.0, height_m) if low else project_shape(shape, pose)
        parts.append(Part(shape, pose, area, bottom, top))
    return tuple(parts)


def _drop(shapes: Sequence[Part], settled: Sequence[Part], ground: float) -> float:
    """Return how far [m] a body of these shapes falls."""
    gaps = [min(shape.bottom for shape in shapes) - ground]
    for shape in shapes:
        for below in _overlapping(shape, settled):
            if below.top <= shape.bottom:
                gaps.append(shape.bottom - below.top)
            elif below.bottom < shape.bottom:
                return 0.0
    drop = min(gaps)
    return drop if drop > GAP_M else 0.0


def _overlapping(shape: Part, others: Sequence[Part]) -> Iterator[Part]:
    """Yield the ``others`` whose footprint the inner part of a shape's footprint meets."""
    x, y, reach = bounding_circle(shape.area)
    inner = (shape.area.vertices - (x, y)) * _INNER + (x, y)
    for other in others:
        ox, oy, circle = bounding_circle(other.area)
        near = reach + circle
        if (ox - x) * (ox - x) + (oy - y) * (oy - y) >= near * near:
            continue
        radius = shape.area.radius * _INNER + other.area.radius
        if polygon_distance(inner, other.area.vertices, radius) <= radius:
            yield other
