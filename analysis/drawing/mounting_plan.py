"""The content of a drawing of a robot's mounts, in millimetres from its datum."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evoros.base.arrays import Array

X, Y, Z = range(3)


@dataclass(frozen=True, eq=False)
class Solid:
    """A convex part of the robot."""

    points_mm: Array  # (n, 3)
    wheel: bool


@dataclass(frozen=True, eq=False)
class PlacedSensor:
    """A sensor in the robot's frame: x forward, y left, z up from the ground."""

    name: str
    place_mm: Array  # (3,)
    yaw_deg: float  # left positive
    pitch_deg: float  # nose up positive
    fov_deg: float | None  # None: it casts no rays
    reach: str  # its range, or the zone of a bumper, in words
    corners_mm: Array  # (n, 3) of its body; none: it has no size

    @property
    def direction(self) -> Array:
        """The unit vector (3,) along the beam."""
        yaw, pitch = np.radians(self.yaw_deg), np.radians(self.pitch_deg)
        ahead = np.cos(pitch)
        direction: Array = np.array([ahead * np.cos(yaw), ahead * np.sin(yaw), np.sin(pitch)])
        return direction


@dataclass(frozen=True, eq=False)
class MountingPlan:
    """The content of a drawing; lengths from the origin of the robot's frame, the datum."""

    title: str
    source: str
    datum: str  # where the origin is, in words
    solids: Sequence[Solid]
    sensors: Sequence[PlacedSensor]
    centre_mm: Array | None  # of mass (3,)
    axles_mm: Sequence[float]  # x of the axes of wheels

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """The lower and upper corner (3,) of the box around the robot and its datum."""
        parts = [solid.points_mm for solid in self.solids]
        points = np.concatenate([np.zeros((1, 3)), *parts, *[s.corners_mm for s in self.sensors]])
        places = np.array([sensor.place_mm for sensor in self.sensors]).reshape(-1, 3)
        points = np.concatenate([points, places])
        return points.min(axis=0), points.max(axis=0)
