"""The movable bodies of a world that a robot can push over level ground."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evoros.base.arrays import Array
from evoros.geometry.contact import polygon_contact
from evoros.geometry.footprint import Footprint, bounding_circle
from evoros.geometry.shapes import Body
from evoros.world.model import World
from evoros.world.standing import GAP_M, Part, place_parts, standing_obstacles

OVERLAP_M = 1e-3
"""A body that overlaps another one by more, seen from above, carries it or is carried."""


class Pushable(NamedTuple):
    """A movable body that stands alone on the ground."""

    body: Body
    parts: tuple[Part, ...]
    radius: float  # [m] about its centre of mass
    arm: float  # [m], the largest moment of its friction about the vertical by the largest force


def split_obstacles(world: World, height_m: float) -> tuple[tuple[Body, ...], tuple[Pushable, ...]]:
    """Return the obstacles that stay, and those that a robot of some height [m] can push.

    A movable body stays if it carries another one, is carried by one or overlaps one.
    """
    bodies = standing_obstacles(world)
    parts = [place_parts(body, height_m) for body in bodies]
    fixed, pushable = [], []
    for i, body in enumerate(bodies):
        others = [part for j, other in enumerate(parts) if j != i for part in other]
        stands = body.mass is not None and min(part.bottom for part in parts[i]) <= GAP_M
        if stands and all(_penetration(a, b) <= OVERLAP_M for b in others for a in parts[i]):
            pushable.append(_describe(body, parts[i]))
        else:
            fixed.append(body)
    return tuple(fixed), tuple(pushable)


def _penetration(first: Part, second: Part) -> float:
    """Return how deep [m] two shapes overlap, seen from above; 0 if one is high above the other."""
    if first.bottom > second.top + GAP_M or second.bottom > first.top + GAP_M:
        return 0.0
    (ax, ay, reach), (bx, by, other) = bounding_circle(first.area), bounding_circle(second.area)
    if math.hypot(bx - ax, by - ay) >= reach + other:
        return 0.0
    a, b = first.area, second.area
    return polygon_contact(a.vertices, b.vertices, a.radius, b.radius)[0]


def _describe(body: Body, parts: tuple[Part, ...]) -> Pushable:
    centre = np.array(body.pose.position[:2])
    circles = [bounding_circle(part.area) for part in parts]
    radius = max(math.dist((x, y), centre) + reach for x, y, reach in circles)
    lowest = min(part.bottom for part in parts)
    carrying = [part.area for part in parts if part.bottom <= lowest + GAP_M]
    return Pushable(body, parts, radius, _friction_arm(carrying, centre))


def _friction_arm(areas: Sequence[Footprint], centre: Array) -> float:
    """Return the mean distance [m] of what carries a body from its centre of mass.

    That is the ratio of the largest moment to the largest force of friction. Footprints carry by
    their corners or rims alike, as rigid bodies do in engines; even pressure would give about half.
    """
    arms = [np.linalg.norm(area.vertices - centre, axis=1) for area in areas]
    rims = [area.radius for area in areas]
    points = [math.hypot(a, rim) for arm, rim in zip(arms, rims, strict=True) for a in arm.tolist()]
    return math.fsum(points) / len(points)
