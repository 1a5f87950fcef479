"""Moments of inertia of solid shapes and of masses away from the centre."""

import numpy as np

from evoros.base.arrays import Array
from evoros.geometry.shapes import Shape, Vector


def solid_moments(shape: Shape, mass: float) -> Vector:
    """Return the principal moments [kg m2] of a homogeneous box or cylinder of a mass [kg]."""
    if shape.kind == "box":
        x, y, z = shape.size
        return (
            mass / 12 * (y * y + z * z),
            mass / 12 * (x * x + z * z),
            mass / 12 * (x * x + y * y),
        )
    radius, length = shape.size
    across = mass / 12 * (3 * radius * radius + length * length)
    return (across, across, mass / 2 * radius * radius)


def point_tensor(mass: float, offset: Array) -> Array:
    """Return the inertia tensor (3, 3) [kg m2] of a point mass at ``offset`` (3,) [m].

    By the parallel axis theorem this is what a body's tensor gains if it is taken about a point
    from which the centre of mass is ``offset`` away.
    """
    tensor: Array = mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    return tensor


def symmetric_tensor(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> Array:
    """Return the symmetric matrix (3, 3) of these six moments."""
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
