"""The inertia of a link of an SDF file: as it is given, computed from its shapes, or assumed."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.base.linear import principal_axes
from evoros.formats.notes import Notes
from evoros.formats.sdf.frames import Frames, Path
from evoros.formats.strict_xml import find_child, is_set, read_numbers
from evoros.geometry.inertia import solid_centre, solid_volume, symmetric_tensor
from evoros.geometry.shapes import Pose, Shape

_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_ASSUMED = "the inertia of homogeneous shapes is assumed"


@dataclass(frozen=True, eq=False)
class Inertia:
    """The inertia of a link; ``pose`` is at its centre of mass, in the world."""

    mass: float  # [kg]
    pose: Pose
    moments: Array | None  # (3, 3) [kg m2] about the axes of ``pose``; None: not given


Weights = Iterable[tuple[Shape, Pose, float]]
"""Shapes with their poses in the world and their densities [kg/m3]."""


def read_inertia(
    link: Element, path: Path, frames: Frames, weights: Weights, notes: Notes
) -> Inertia:
    """Read the inertia of a link; mass and moments that cannot be are replaced, and noted."""
    inertial = find_child(link, "inertial")
    if inertial is None:
        return Inertia(1.0, frames.world_pose(path), None)
    if is_auto(link):
        return _compute_inertia(frames.world_pose(path), weights)
    element = find_child(inertial, "mass")
    mass = 1.0 if element is None else read_numbers(element, 1)[0]
    pose = frames.resolve(inertial, path)
    if element is not None and mass <= 0:
        notes.add(element, f"must be greater than 0, not {mass:g}: 1 kg is assumed", "no mass")
        return Inertia(1.0, pose, None)
    moments = find_child(inertial, "inertia")
    return Inertia(mass, pose, None if moments is None else _read_moments(moments, notes))


def is_auto(link: Element) -> bool:
    """Whether the inertia of a link is to be computed from its collisions."""
    inertial = link.find("inertial")
    return inertial is not None and is_set(inertial, "auto")


def _compute_inertia(pose: Pose, weights: Weights) -> Inertia:
    """Return mass and centre of homogeneous shapes."""
    mass, moment = 0.0, np.zeros(3)
    for shape, place, density in weights:
        if shape.kind in ("plane", "heightfield"):
            continue
        share = density * solid_volume(shape)
        mass += share
        moment += share * np.array(place.transform(solid_centre(shape)))
    if mass <= 0:
        return Inertia(1.0, pose, None)
    x, y, z = (moment / mass).tolist()
    return Inertia(mass, Pose((x, y, z), pose.quaternion), None)


def _read_moments(inertia: Element, notes: Notes) -> Array | None:
    """Read the moments; None if no solid has them."""
    values = {
        tag: read_numbers(element, 1)[0]
        for tag in _MOMENTS
        if (element := find_child(inertia, tag)) is not None
    }
    lacking = [tag for tag in _MOMENTS[:3] if tag not in values]
    if lacking:
        notes.add(inertia, f"has no {', '.join(lacking)}: {_ASSUMED}", "moments lacking")
        return None
    tensor = symmetric_tensor(*(values.get(tag, 0.0) for tag in _MOMENTS))
    if principal_axes(tensor)[0][0] <= 0:
        problem = f"is not positive definite, so that no solid can have it: {_ASSUMED}"
        notes.add(inertia, problem, "moments impossible")
        return None
    return tensor
