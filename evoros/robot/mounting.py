"""Sensor mounting: the default mount, mounting poses and sensor frames."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from evoros.base.arrays import Array
from evoros.base.checks import NUMBER, TEXT, checked
from evoros.compilation.elementary_arrays import atan2_all, cos_all, sin_all
from evoros.robot.outline import SolidShape, compute_outline
from evoros.sensor.protocol import Sensor, sees

Places = Mapping[str, tuple[float, float, float, float]]
"""Poses of the links that can carry sensors, in the robot's frame: x, y, z [m], yaw [rad]."""


@dataclass(frozen=True)
@checked
class MountDefaults:
    """Default values of mount parameters that a design region does not set.

    None selects the link with the largest area in top view, the middle height of that link's
    collision shapes, and the pitch at which the lowest ray of the sensors is level.
    """

    link: Annotated[str | None, TEXT] = None
    z_m: Annotated[float | None, NUMBER] = None  # relative to ``link``
    pitch_deg: Annotated[float | None, NUMBER] = None  # nose up positive


class FittedMount(NamedTuple):
    """The default mount of a robot, in which only the pitch may be None."""

    link: str
    z_m: float
    pitch_deg: float | None  # None: depends on the sensors
    chosen: tuple[str, ...]  # keys of MountDefaults that were None


def fit_mount(mount: MountDefaults, places: Places, solids: Sequence[SolidShape]) -> FittedMount:
    """Replace None in ``mount`` with values derived from the links and collision shapes."""
    link = _find_carrier(places, solids) if mount.link is None else mount.link
    z = mount.z_m
    if z is None:
        ranges = [solid.height_range for solid in solids if solid.link == link]
        lows, highs = zip(*(ranges or [solid.height_range for solid in solids]), strict=True)
        middle = 0.5 * (max(min(lows), 0.0) + max(highs))
        z = middle - (places[link][2] if link in places else 0.0)
    pitch = None if mount.pitch_deg is None else float(mount.pitch_deg)
    chosen = tuple(name for name, value in vars(mount).items() if value is None)
    return FittedMount(link, float(z), pitch, chosen)


def level_pitch(sensors: Iterable[Sensor]) -> float:
    """Return the minimum pitch [deg], nose up, at which no ray points down; 0 with rear rays."""
    rays = [sensor.rays().T for sensor in sensors if sees(sensor)]
    drops = [float(atan2_all(-z, x).max()) for x, _, z in rays if x.min() > 0.0]
    return max((round(math.degrees(drop), 6) for drop in drops if drop > 0.0), default=0.0)


def _find_carrier(places: Places, solids: Sequence[SolidShape]) -> str:
    def area(link: str) -> float:
        shapes = [(solid.shape, solid.pose) for solid in solids if solid.link == link]
        if not shapes:
            return 0.0
        (x, y), (next_x, next_y) = (corners := compute_outline(shapes)).T, np.roll(corners, -1, 0).T
        return 0.5 * float(np.sum(x * next_y - next_x * y))

    return max(places, key=area)


_RADIAN = math.pi / 180.0  # radians per degree


def place_on_links(links: Array, poses: Array) -> Array:
    """Return poses (n, 5) in the robot's frame: x, y, z [m], yaw (left), pitch (nose up) [rad].

    ``poses`` (n, 5) [m, deg] are relative to ``links`` (n, 4) or (4,): x, y, z [m], yaw [rad].
    """
    x, y, z, yaw = links.T
    sin, cos = sin_all(yaw), cos_all(yaw)
    along, across, up, turn, pitch = poses.T
    placed = (
        x + cos * along - sin * across,
        y + sin * along + cos * across,
        z + up,
        yaw + turn * _RADIAN,
        pitch * _RADIAN,
    )
    return np.ascontiguousarray(np.stack(placed, axis=1))


def make_frames(poses: Array) -> Array:
    """Return the frames (n, 4, 4) [m] of poses (n, 5) [m, rad]; x points along the beam."""
    x, y, z, yaw, pitch = poses.T
    sy, cy, sp, cp = sin_all(yaw), cos_all(yaw), sin_all(pitch), cos_all(pitch)
    none, one = np.zeros(len(poses)), np.ones(len(poses))
    rows = (
        (cy * cp, -sy, -cy * sp, x),
        (sy * cp, cy, -sy * sp, y),
        (sp, none, cp, z),
        (none, none, none, one),
    )
    return np.ascontiguousarray(np.moveaxis(np.array(rows), 2, 0))
