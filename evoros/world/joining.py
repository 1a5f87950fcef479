"""Joins bodies that overlap, so that they move as one."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from evoros.formats.sdf.bodies import combine_inertias
from evoros.formats.sdf.inertial import Inertia
from evoros.geometry.footprint import bottom_height
from evoros.geometry.inertia import joint_moments
from evoros.geometry.shapes import Body


def join_bodies(bodies: Sequence[Body]) -> Body:
    """Join movable bodies into one, named after the first.

    It has the friction of the body that reaches lowest, as a model of several links has.
    """
    mass, pose, moments = combine_inertias([_weigh(body) for body in bodies])
    inverse = pose.inverse()
    shapes = tuple(
        replace(shape, pose=inverse @ body.pose @ shape.pose)
        for body in bodies
        for shape in body.shapes
    )
    return Body(bodies[0].name, pose, shapes, mass, min(bodies, key=_bottom).friction, moments)


def fix_body(body: Body) -> Body:
    """Return a movable body as a fixed one."""
    return replace(body, mass=None, inertia=None)


def group_pairs(pairs: Iterable[tuple[int, int]]) -> list[list[int]]:
    """Return the groups of numbers that pairs connect, each in ascending order."""
    groups: dict[int, list[int]] = {}
    for a, b in pairs:
        first, second = groups.setdefault(a, [a]), groups.setdefault(b, [b])
        if first is not second:
            first += second
            groups.update(dict.fromkeys(second, first))
    return [sorted(group) for group in {id(group): group for group in groups.values()}.values()]


def _weigh(body: Body) -> Inertia:
    mass = body.mass or 0.0
    return Inertia(mass, body.pose, np.diag(body.inertia or joint_moments(body.shapes, mass)))


def _bottom(body: Body) -> float:
    return min(bottom_height(shape, body.pose @ shape.pose) for shape in body.shapes)
