"""What a sensor must offer, and where it is mounted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from evoros.base.arrays import Array
from evoros.filter.protocol import Filter


@dataclass(frozen=True)
class Mount:
    """One sensor on the robot: its type and the pose of its frame in the frame of ``link``."""

    sensor: str  # name of the sensor type, a key of the design's ``sensors``
    link: str
    x_m: float
    y_m: float
    z_m: float
    yaw_deg: float  # left positive
    pitch_deg: float  # nose up positive


@runtime_checkable
class Sensor(Protocol):
    """A type of range sensor: what it sees along which rays, how often, how well."""

    @property
    def period_s(self) -> float:
        """Time between two readings."""
        ...

    @property
    def range_min_m(self) -> float:
        """The least that it can read."""
        ...

    @property
    def range_max_m(self) -> float:
        """What it reads where it sees nothing."""
        ...

    @property
    def filters(self) -> Mapping[str, Filter]:
        """By name, applied in order to the readings of this type: first of all its noise."""
        ...

    @property
    def size_m(self) -> Sequence[float]:
        """Lengths (3,) of its body, a box about its frame's origin; it touches nothing."""
        ...

    @property
    def mass_kg(self) -> float:
        """Mass of its body, greater than 0: simulators drop a body without mass."""
        ...

    def rays(self) -> Array:
        """(k, 3) unit vectors in the sensor's frame (x forward); the nearest hit is the reading."""
        ...

    def gazebo(self, name: str) -> str:
        """The ``<sensor>`` element (SDF) that makes Gazebo simulate this sensor."""
        ...
