"""Measures the radius, width and roundness of wheels from their shapes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array, length, product
from evoros.compilation.elementary_arrays import cos_all, sin_all
from evoros.formats.urdf.parts import Joint
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.polyhedron import box_corners, placed_corners
from evoros.geometry.shapes import Pose, Shape

_RIM = 64  # number of points on the rim of a cylinder
_TREAD = 0.9  # fraction of the radius above which points belong to the tread, not the hub
_ALONG = 1.0 - 1e-6  # minimum cosine of the angle between parallel axes


class Wheel(NamedTuple):
    """A wheel as a cylinder about its axle."""

    centre: Array  # (3,) [m], centre of the tread
    radius: float  # [m]
    width: float  # [m], width of the tread
    roundness: float  # missing fraction of the radius in the worst direction; 0 if round

    @property
    def bottom(self) -> float:
        """The height [m] of the lowest point, for a level axle."""
        return float(self.centre[2]) - self.radius


@dataclass(frozen=True, eq=False)
class Candidate:
    """A joint whose child link looks like a wheel on the ground."""

    joint: Joint
    wheel: Wheel  # frame: root link
    turns: bool  # whether the joint can rotate
    steering: Joint | None  # joint that steers the wheel

    @property
    def x(self) -> float:
        """The longitudinal position [m] in the robot's frame."""
        return float(self.wheel.centre[0])

    @property
    def y(self) -> float:
        """The lateral position [m] in the robot's frame, left positive."""
        return float(self.wheel.centre[1])


Pair = tuple[Candidate, Candidate]  # opposite wheels: left, right


def group_shapes(urdf: Urdf, link: str) -> list[tuple[Shape, Pose]]:
    """Return the shapes of a link and of all links fixed to it, with poses in its frame."""
    return [
        (shape, pose @ shape.pose)
        for name, pose in urdf.rigid_group(link).items()
        for shape in urdf.shapes[name]
    ]


def measure_wheel(shapes: Sequence[tuple[Shape, Pose]], axis: Array) -> Wheel:
    """Measure the wheel formed by shapes, about a central axis in the direction ``axis`` (3,)."""
    if len(shapes) == 1:
        shape, pose = shapes[0]
        if shape.kind == "sphere":
            return Wheel(np.array(pose.position), shape.size[0], 2.0 * shape.size[0], 0.0)
        if shape.kind == "cylinder" and abs(float(product(pose.rotation[:, 2], axis))) > _ALONG:
            return Wheel(np.array(pose.position), shape.size[0], shape.size[1], 0.0)
    points = np.concatenate([shape_points(shape, pose) for shape, pose in shapes])
    first = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    first /= length(first)
    across = np.stack([first, np.cross(axis, first)])
    flat, along = product(points, across.T), product(points, axis)
    low, high = flat.min(axis=0), flat.max(axis=0)
    middle = (low + high) / 2
    distances = np.sqrt(((flat - middle) ** 2).sum(axis=1))
    radius = float(distances.max())
    tread = along[distances >= _TREAD * radius]
    half = (tread.min() + tread.max()) / 2
    # A circle has the same width in every direction.
    angles = np.arange(12) * (math.pi / 12)
    widths = np.ptp(product(flat, np.stack([cos_all(angles), sin_all(angles)])), axis=0)
    roundness = 1.0 - float(widths.min()) / (2.0 * radius) if radius > 0 else 1.0
    return Wheel(product(middle, across) + half * axis, radius, float(np.ptp(tread)), roundness)


def shape_points(shape: Shape, pose: Pose) -> Array:
    """Return points (n, 3) whose hull is the shape, approximately for round shapes."""
    if shape.kind == "convex":
        local = np.array(shape.corners)
    elif shape.kind == "box":
        local = box_corners(shape)
    elif shape.kind == "cylinder":
        rim = _circle() * shape.size[0]
        half = np.array([0.0, 0.0, shape.size[1] / 2])
        local = np.concatenate([rim - half, rim + half])
    else:
        turns = map(elementary.sin_cos, np.linspace(0.0, math.pi, 17))
        rings = [_circle() * sin + np.array([0.0, 0.0, cos]) for sin, cos in turns]
        local = shape.size[0] * np.concatenate(rings)
    return placed_corners(local, pose.rotation, pose.position)


def _circle() -> Array:
    angles = np.arange(_RIM) * (2.0 * math.pi / _RIM)
    return np.stack([cos_all(angles), sin_all(angles), np.zeros(_RIM)], axis=1)
