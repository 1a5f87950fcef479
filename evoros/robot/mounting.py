"""The default mount of a sensor, as configured or chosen for a robot that states none."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from evoros.base.checks import NUMBER, TEXT, checked
from evoros.compilation.elementary_arrays import atan2_all
from evoros.robot.outline import SolidShape, compute_outline
from evoros.sensor.protocol import RangeSensor, Sensor, sees

Places = Mapping[str, tuple[float, float, float, float]]
"""Links that can carry sensors: x, y, z [m], yaw [rad] in the robot's frame."""


@dataclass(frozen=True)
@checked
class MountDefaults:
    """The default mount of a sensor, for values that its region leaves open.

    None is chosen for the robot: the link that carries most of the chassis, the middle of the
    heights of its collision shapes, and the pitch that levels the lowest ray of the sensors.
    """

    link: Annotated[str | None, TEXT] = None
    z_m: Annotated[float | None, NUMBER] = None  # in the frame of ``link``
    pitch_deg: Annotated[float | None, NUMBER] = None  # nose up positive


class FittedMount(NamedTuple):
    """The default mount on its robot."""

    link: str
    z_m: float
    pitch_deg: float | None  # None: depends on the sensors
    chosen: tuple[str, ...]  # the keys that were None


def fit_mount(mount: MountDefaults, places: Places, solids: Sequence[SolidShape]) -> FittedMount:
    """Choose what ``mount`` leaves open on a robot with these links and collision shapes."""
    link = _find_carrier(places, solids) if mount.link is None else mount.link
    z = mount.z_m
    if z is None:
        z = _middle_height(solids, link) - (places[link][2] if link in places else 0.0)
    values = {"link": mount.link, "z_m": mount.z_m, "pitch_deg": mount.pitch_deg}
    pitch = None if mount.pitch_deg is None else float(mount.pitch_deg)
    chosen = tuple(name for name, value in values.items() if value is None)
    return FittedMount(link, float(z), pitch, chosen)


def level_pitch(sensors: Iterable[Sensor]) -> float:
    """Return the pitch [deg], nose up, at which no ray of any of the sensors points down.

    It is 0 for a sensor that sees behind itself, which tilting would point at the ground there.
    """
    return max((_level_pitch(sensor) for sensor in sensors if sees(sensor)), default=0.0)


def _level_pitch(sensor: RangeSensor) -> float:
    x, _, z = sensor.rays().T
    if x.min() <= 0.0:
        return 0.0
    return max(0.0, round(math.degrees(float(atan2_all(-z, x).max())), 6))


def _find_carrier(places: Places, solids: Sequence[SolidShape]) -> str:
    """Return the link that covers the largest area from above; the first one if none has shapes."""

    def area(link: str) -> float:
        shapes = [(solid.shape, solid.pose) for solid in solids if solid.link == link]
        if not shapes:
            return 0.0
        (x, y), (next_x, next_y) = (corners := compute_outline(shapes)).T, np.roll(corners, -1, 0).T
        return 0.5 * float(np.sum(x * next_y - next_x * y))

    return max(places, key=area)


def _middle_height(solids: Sequence[SolidShape], link: str) -> float:
    """Return the middle [m] of the heights of a link's shapes, or of all if it has none."""
    ranges = [solid.height_range for solid in solids if solid.link == link]
    ranges = ranges or [solid.height_range for solid in solids]
    low, high = min(low for low, _ in ranges), max(high for _, high in ranges)
    return 0.5 * (max(low, 0.0) + high)
