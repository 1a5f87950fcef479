"""The protocol of regions: parts of the robot in which sensors may be placed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

from evoros.base.errors import InputError
from evoros.formats.strict_xml import list_names, quote
from evoros.geometry.shapes import Vector
from evoros.robot.model import Robot
from evoros.sensor.protocol import Sensor

Point = tuple[float, float]
Range = tuple[float, float]

POSITION = ("x_m", "y_m", "z_m", "arc")
"""The genes of a sensor's position, in their order; ``arc`` is the share of a way along a curve."""
ANGLES = ("yaw_deg", "pitch_deg")


class SensorPose(NamedTuple):
    """The pose of a sensor in the frame of its link."""

    position: Vector  # [m]
    yaw_deg: float  # left positive
    pitch_deg: float  # nose up positive


@dataclass(frozen=True)
class Area:
    """The places and directions that a sensor may have, in the robot's frame.

    If ``facing_deg`` is empty, the places are a polygon and the headings do not depend on the
    place. Otherwise they are a line, each of whose segments has an entry.
    """

    link: str
    corners: tuple[Point, ...]  # [m]
    yaw_deg: Range  # all possible headings
    z_m: Range  # in the frame of the link
    pitch_deg: Range
    facing_deg: tuple[Range, ...] = ()  # the headings on each segment of a line


class BoundRegion(Protocol):
    """A region on its robot."""

    @property
    def link(self) -> str:
        """The link that carries the sensor."""

    @property
    def ranges(self) -> Mapping[str, Range]:
        """The minimum and maximum of each of POSITION and ANGLES that the region uses."""

    def place(self, values: Mapping[str, float]) -> SensorPose:
        """Return the pose of a sensor with a value for each of ``ranges``."""

    def area(self) -> Area:
        """Return the places and directions for drawing."""


@runtime_checkable
class RegionDescription(Protocol):
    """Describes a region for any robot."""

    @property
    def overhang_m(self) -> float:
        """How far a sensor may stand out from the robot."""

    def bind(
        self, robot: Robot, mirrored: bool, key: str, sensors: Sequence[Sensor]
    ) -> BoundRegion:
        """Return this region on ``robot``, which carries these types of sensors.

        ``key`` is the region's key in the configuration, for messages.

        Raises:
            InputError: the region, or its mirror image if ``mirrored``, is off the robot.
        """


def check_link(link: str, robot: Robot, mirrored: bool, key: str) -> None:
    """Raise an InputError if a link cannot carry the sensors, or ``mirrored`` twins, of ``key``."""
    if link not in robot.sensor_links:
        raise InputError(
            f"{key}.link: must be a link of {robot.name} that can carry sensors, "
            f"not {quote(link)}; choose one of {list_names(robot.sensor_links)}, or design=around"
        )
    _, y, _, yaw = robot.sensor_links[link]
    if mirrored and (y, yaw) != (0, 0):
        raise InputError(
            f"{key}.link: must lie on the robot's x axis and face along it if sensors are "
            f"mirrored, not {link!r} at y {y:g} m, yaw {yaw:g} rad; "
            f"choose another link or set mirrored to false"
        )
