"""The interface of regions, which are parts of the robot where sensors may be placed."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from evoros.base.errors import InputError
from evoros.formats.strict_xml import list_names, quote
from evoros.geometry.shapes import Vector
from evoros.robot.model import Robot
from evoros.sensor.protocol import Sensor

Point = tuple[float, float]
Range = tuple[float, float]
POSITION = ("x_m", "y_m", "z_m", "arc")  # genes in order; ``arc`` is a fraction of a curve's length
ANGLES = ("yaw_deg", "pitch_deg")


class SensorPose(NamedTuple):
    """The pose of a sensor in the frame of its link."""

    position: Vector  # [m]
    yaw_deg: float  # positive to the left
    pitch_deg: float  # positive nose-up


@dataclass(frozen=True)
class Area:
    """Possible positions and headings of a sensor, in the robot's frame.

    If ``facing_deg`` is empty, ``corners`` form a polygon, and headings do not depend on the
    position. Otherwise, ``corners`` form a line with a range of headings per segment.
    """

    link: str
    corners: tuple[Point, ...]  # [m]
    yaw_deg: Range  # all possible headings
    z_m: Range  # relative to the link
    pitch_deg: Range
    facing_deg: tuple[Range, ...] = ()  # headings on each segment of a line


class BoundRegion(Protocol):
    """A region bound to a robot."""

    @property
    def link(self) -> str:
        """The name of the link that carries the sensor."""

    @property
    def ranges(self) -> Mapping[str, Range]:
        """(minimum, maximum) of each value in POSITION and ANGLES used by the region."""

    def place(self, values: Mapping[str, float]) -> SensorPose:
        """Return the pose of a sensor; ``values`` has the same keys as ``ranges``."""

    def area(self) -> Area:
        """Return the possible positions and headings, for drawing."""


class RegionDescription(ABC):
    """A region not yet bound to a robot."""

    overhang_m: float = 0.0  # maximum distance [m] of a sensor outside the outline

    @abstractmethod
    def bind(
        self, robot: Robot, mirrored: bool, key: str, sensors: Sequence[Sensor]
    ) -> BoundRegion:
        """Return this region, configured at ``key``, bound to a robot that carries ``sensors``.

        A region, or with ``mirrored`` a mirror image, that is off the robot raises an InputError.
        """


def check_link(link: str, robot: Robot, mirrored: bool, key: str) -> None:
    """Raise an InputError if a link cannot carry the sensors (or mirrored sensors) at ``key``."""
    if link not in robot.sensor_links:
        raise InputError(
            f"{key}.link: must be a link of {robot.name} that can carry sensors, "
            f"not {quote(link)}; choose one of {list_names(robot.sensor_links)}, or design=around"
        )
    _, y, _, yaw = robot.sensor_links[link]
    if mirrored and (y, yaw) != (0, 0):
        raise InputError(
            f"{key}.link: must lie on the robot's x axis and face along the axis if sensors are "
            f"mirrored, not {link!r} at y {y:g} m, yaw {yaw:g} rad; "
            f"choose another link or set mirrored to false"
        )


def require_height(link: str, robot: Robot, key: str) -> None:
    """Raise an InputError for a link without a default height, for which ``key`` must be set."""
    if link != robot.mount_link:
        raise InputError(
            f"{key}: must be set for the link {link}, because the robot's default height applies "
            f"only to {robot.mount_link}"
        )
