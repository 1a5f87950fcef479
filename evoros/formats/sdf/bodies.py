"""The bodies that the links of an SDF model make."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from evoros.base.arrays import Array
from evoros.base.linear import principal_axes, product
from evoros.formats.notes import Notes
from evoros.formats.sdf.inertial import Inertia
from evoros.formats.sdf.links import Link, Solid
from evoros.geometry.footprint import bottom_height
from evoros.geometry.inertia import point_tensor
from evoros.geometry.shapes import Body, Pose, Vector


def build_fixed_bodies(links: Sequence[Link]) -> list[Body]:
    """Build one body for each collision of static links: each keeps its own friction."""
    solids = [(link.path, solid) for link in links for solid in link.solids]
    return [
        Body(
            path[0] if len(solids) == 1 else "::".join((*path, solid.name)),
            solid.pose,
            solid.shapes,
            friction=solid.friction,
        )
        for path, solid in solids
    ]


def build_movable_body(links: Sequence[Link], alone: bool, notes: Notes) -> list[Body]:
    """Build the body of links that move as one; none if nothing can touch it.

    A body that is ``alone`` in its model may have the model's name.
    If its collisions differ in friction, the lowest one, which touches the ground, gives it.
    """
    first = links[0]
    solids = [solid for link in links for solid in link.solids]
    if not solids:
        notes.add(first.element, "is ignored: it has no collision, so nothing can touch it")
        return []
    inertias = [link.inertia for link in links if link.inertia is not None]
    mass, pose, moments = combine_inertias(inertias)
    inverse = pose.inverse()
    shapes = tuple(
        replace(shape, pose=inverse @ solid.place(shape))
        for solid in solids
        for shape in solid.shapes
    )
    friction = solids[0].friction
    if any(solid.friction != friction for solid in solids):
        friction = min(solids, key=_bottom).friction
        values = ", ".join(f"{value:g}" for value in sorted({s.friction for s in solids}))
        problem = f"has collisions of friction {values}; all get the lowest one's, {friction:g}"
        notes.add(first.element, problem, "frictions")
    name = first.path[0] if alone else "::".join(first.path)
    return [Body(name, pose, shapes, mass, friction, moments)]


def _bottom(solid: Solid) -> float:
    return min(bottom_height(shape, solid.place(shape)) for shape in solid.shapes)


def combine_inertias(parts: Sequence[Inertia]) -> tuple[float, Pose, Vector | None]:
    """Return mass, principal frame in the world and principal moments of parts joined rigidly."""
    moments = parts[0].moments
    if len(parts) == 1 and moments is None:
        return parts[0].mass, parts[0].pose, None
    if len(parts) == 1 and moments is not None:
        diagonal = np.diag(moments)
        if not np.count_nonzero(moments - np.diag(diagonal)):
            return parts[0].mass, parts[0].pose, _to_vector(diagonal)
    masses = np.array([part.mass for part in parts])
    mass = float(masses.sum())
    centre = product(masses, np.array([part.pose.position for part in parts])) / mass
    total = np.zeros((3, 3))
    for part in parts:
        if part.moments is None:
            return mass, Pose(_to_vector(centre), parts[0].pose.quaternion), None
        rotation = part.pose.rotation
        total += product(product(rotation, part.moments), rotation.T)
        total += point_tensor(part.mass, np.array(part.pose.position) - centre)
    principal, axes = principal_axes(total)
    return mass, Pose.from_matrix(_to_vector(centre), axes), _to_vector(principal)


def _to_vector(values: Array) -> Vector:
    x, y, z = (float(value) for value in values)
    return (x, y, z)
