"""What a sensor must offer, where it is mounted, and how its readings are named."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeGuard, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.checks import POSITIVE, Rule, invalid, is_number
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


BOX = Rule(
    "a list of three lengths greater than 0",
    lambda v: isinstance(v, list | tuple) and len(v) == 3 and all(map(POSITIVE.holds, v)),
)
BEAM = Rule("an angle greater than 0 and less than 180", lambda v: is_number(v) and 0 < v < 180)

RANGE = "range"
"""What a sensor measures that casts rays: distances [m]."""


class Channel(NamedTuple):
    """One of the values that a sensor reads."""

    name: str  # of the quantity, the begin of its columns: range
    unit: str  # the end of its columns: m
    low: float  # the minimum reading, -inf if there is none
    high: float  # the maximum reading; that of a range is what the sensor reads if it sees nothing


@runtime_checkable
class Sensor(Protocol):
    """A type of sensor: what it measures on how many channels, how often, how well."""

    @property
    def period_s(self) -> float:
        """Time between two readings."""
        ...

    @property
    def measures(self) -> str:
        """What a simulator must offer to it: ``range``, along the rays of a ``RangeSensor``."""
        ...

    @property
    def channels(self) -> Sequence[Channel]:
        """The values of one reading, at least one."""
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

    def gazebo(self, name: str) -> str:
        """The ``<sensor>`` element (SDF) that makes Gazebo simulate this sensor."""
        ...


@runtime_checkable
class RangeSensor(Sensor, Protocol):
    """A type of sensor that measures distances along rays, all of them with the same limits."""

    @property
    def range_min_m(self) -> float:
        """The least that it can read."""
        ...

    @property
    def range_max_m(self) -> float:
        """What it reads where it sees nothing."""
        ...

    def rays(self) -> Array:
        """(k, 3) unit vectors in the sensor's frame, x forward."""
        ...

    def channel_of(self) -> NDArray[np.int64]:
        """(k,) the channel of each ray, whose reading is the nearest hit of all its rays."""
        ...


def check_limits(sensor: RangeSensor) -> None:
    """Hold the minimum range below the maximum; for ``__post_init__``.

    Raises:
        InputError: it is not.
    """
    if sensor.range_min_m >= sensor.range_max_m:
        rule = f"must be less than range_max_m ({sensor.range_max_m})"
        raise invalid(sensor, "range_min_m", sensor.range_min_m, rule)


def sees(sensor: Sensor) -> TypeGuard[RangeSensor]:
    """Whether a sensor casts rays."""
    return sensor.measures == RANGE


def sensor_bearings(sensor: RangeSensor) -> list[float]:
    """Return the bearing [rad] of the middle of each channel's rays in the sensor's frame."""
    middles = np.zeros((len(sensor.channels), 3))
    np.add.at(middles, sensor.channel_of(), sensor.rays())
    bearings: list[float] = np.arctan2(middles[:, 1], middles[:, 0]).tolist()
    return bearings


def name_channels(sensors: Iterable[Sensor]) -> Iterator[str]:
    """Yield the column of each channel of mounted sensors, in their order.

    ``range_N_m`` is the range of sensor N. A sensor with several channels of one name numbers them
    too, as ``range_N_K_m``.
    """
    for number, sensor in enumerate(sensors):
        sizes = Counter(channel.name for channel in sensor.channels)
        seen = Counter[str]()
        for name, unit, *_ in sensor.channels:
            place = f"{number}" if sizes[name] == 1 else f"{number}_{seen[name]}"
            seen[name] += 1
            yield f"{name}_{place}_{unit}"
