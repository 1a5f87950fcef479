"""Moments of inertia of solid shapes and of offset point masses."""

import math
from collections.abc import Sequence

import numpy as np

from evoros.base.arrays import Array
from evoros.base.linear import product
from evoros.geometry.polyhedron import solid_properties
from evoros.geometry.shapes import Shape, Vector


def solid_moments(shape: Shape, mass: float) -> Vector:
    """Return the principal moments [kg m2] of a homogeneous solid of a mass [kg] about its centre.

    The axes are the shape's, which are principal axes of all shapes except polyhedra.
    """
    if shape.kind == "box":
        x, y, z = shape.size
        return (
            mass / 12 * (y * y + z * z),
            mass / 12 * (x * x + z * z),
            mass / 12 * (x * x + y * y),
        )
    if shape.kind == "sphere":
        moment = 0.4 * mass * shape.size[0] * shape.size[0]
        return (moment, moment, moment)
    if shape.kind == "convex":
        volume, _, tensor = solid_properties(shape.corners)
        xx, yy, zz = (tensor.diagonal() * (mass / volume)).tolist()
        return (xx, yy, zz)
    radius, length = shape.size
    across = mass / 12 * (3 * radius * radius + length * length)
    return (across, across, mass / 2 * radius * radius)


def joint_moments(shapes: Sequence[Shape], mass: float) -> Vector:
    """Return the moments [kg m2] of shapes with one density and a total mass [kg]."""
    volumes = [solid_volume(shape) for shape in shapes]
    total = np.zeros((3, 3))
    for shape, volume in zip(shapes, volumes, strict=True):
        share = mass * volume / sum(volumes)
        rotation = shape.pose.rotation
        total += product(product(rotation, _solid_tensor(shape, share)), rotation.T)
        total += point_tensor(share, np.array(shape.pose.transform(solid_centre(shape))))
    xx, yy, zz = total.diagonal().tolist()
    return (xx, yy, zz)


def solid_volume(shape: Shape) -> float:
    """Return the volume [m3] of a solid shape."""
    if shape.kind == "convex":
        return solid_properties(shape.corners)[0]
    if shape.kind == "box":
        return math.prod(shape.size)
    if shape.kind == "sphere":
        return 4.0 / 3.0 * math.pi * shape.size[0] * shape.size[0] * shape.size[0]
    return math.pi * shape.size[0] * shape.size[0] * shape.size[1]


def solid_centre(shape: Shape) -> Vector:
    """Return the centre of mass [m] of a homogeneous solid shape in the shape's frame."""
    if shape.kind != "convex":
        return (0.0, 0.0, 0.0)
    x, y, z = solid_properties(shape.corners)[1].tolist()
    return (x, y, z)


def _solid_tensor(shape: Shape, mass: float) -> Array:
    if shape.kind != "convex":
        return np.diag(solid_moments(shape, mass))
    volume, _, tensor = solid_properties(shape.corners)
    return tensor * (mass / volume)


def point_tensor(mass: float, offset: Array) -> Array:
    """Return the inertia tensor (3, 3) [kg m2] of a point mass at ``offset`` (3,) [m].

    A body's tensor about a point gains this term if the centre of mass is ``offset`` away (parallel
    axis theorem).
    """
    tensor: Array = mass * (product(offset, offset) * np.eye(3) - np.outer(offset, offset))
    return tensor


def symmetric_tensor(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> Array:
    """Return the symmetric matrix (3, 3) of these six moments."""
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
