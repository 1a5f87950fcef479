"""The interface of sensors, their mounts, and the names of their readings."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeGuard, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.checks import POSITIVE, Rule, invalid, is_number
from evoros.compilation.elementary_arrays import atan2_all
from evoros.compilation.named_rules import Started
from evoros.filter.protocol import Filter


@dataclass(frozen=True)
class Mount:
    """One sensor on the robot: its type and the pose of its frame in the frame of ``link``."""

    sensor: str  # name of the sensor type, a key of the design's ``sensors``
    link: str  # of the robot, to which it is fixed
    x_m: float  # forward
    y_m: float  # left
    z_m: float  # up
    yaw_deg: float  # left positive
    pitch_deg: float  # nose up positive

    @property
    def pose(self) -> tuple[float, float, float, float, float]:
        """The position [m], yaw and pitch [deg]."""
        return self.x_m, self.y_m, self.z_m, self.yaw_deg, self.pitch_deg


BOX = Rule(
    "a list of three lengths greater than 0",
    lambda v: isinstance(v, list | tuple) and len(v) == 3 and all(map(POSITIVE.holds, v)),
)
BEAM = Rule("an angle greater than 0 and less than 180", lambda v: is_number(v) and 0 < v < 180)

RAY_DEG = 1.0
"""Width [deg] that a single ray, or a narrower beam, counts for where coverage is measured.

A ray has no width, and yet a sensor of one ray sees the direction in which it looks. Pictures show
it as a line.
"""

RANGE, MOTION, WHEELS, CONTACT = "range", "motion", "wheels", "contact"
"""The kinds of measurements: distances along rays, how its mount moves, how far the wheels have
rolled, what touches the robot. Simulators offer them; ``signals`` describes the last three."""

SIGNAL_SIZES = {MOTION: 14, WHEELS: 2, CONTACT: 1}
"""The number of values of each signal, as ``signals`` describes them."""


SENSOR_ARGUMENTS = "parameters", "memory", "rng", "signal", "values", "time"
"""The rule of a signal sensor fills its ``values``, a channel each, at ``time`` [s]."""


class Channel(NamedTuple):
    """One of the values that a sensor reads."""

    name: str  # of the quantity, the begin of its columns: range
    unit: str  # the end of its columns: m; empty if it has none
    low: float  # the minimum reading, -inf if there is none
    high: float  # the maximum reading; a range sensor that sees nothing reads it


@runtime_checkable
class Sensor(Protocol):
    """A type of sensor: what it measures on how many channels, how often, how well."""

    @property
    def period_s(self) -> float:
        """Time between two readings."""

    @property
    def measures(self) -> str:
        """The measurement it needs: ``range`` for a ``RangeSensor``, or a signal."""

    @property
    def channels(self) -> Sequence[Channel]:
        """The values of one reading, at least one."""

    @property
    def filters(self) -> Mapping[str, Filter]:
        """By name, applied in order to the readings of this type: first of all its noise."""

    @property
    def size_m(self) -> Sequence[float]:
        """Lengths (3,) of its body, a box about its frame's origin; it touches nothing."""

    @property
    def mass_kg(self) -> float:
        """Mass of its body, greater than 0: simulators drop a body without mass."""

    @property
    def price(self) -> float:
        """Its cost, at least 0, in a unit of the user's choice."""

    def gazebo(self, name: str) -> str:
        """The ``<sensor>`` element (SDF) that makes Gazebo simulate this sensor."""


@runtime_checkable
class RangeSensor(Sensor, Protocol):
    """A type of sensor that measures distances along rays, all of them with the same limits."""

    @property
    def range_min_m(self) -> float:
        """The minimum reading."""

    @property
    def range_max_m(self) -> float:
        """The maximum reading, also if it sees nothing."""

    def rays(self) -> Array:
        """(k, 3) unit vectors in the sensor's frame, x forward."""

    def channel_of(self) -> NDArray[np.int64]:
        """(k,) the channel of each ray, whose reading is the nearest hit of all its rays."""


@runtime_checkable
class SignalSensor(Sensor, Protocol):
    """A type of sensor that computes its readings from a signal: it measures no range."""

    @property
    def rule(self) -> Callable[..., None]:
        """Fill the values, its channels; a static method, so that numba can compile it.

        It takes the arguments that it uses, of those in ``SENSOR_ARGUMENTS``.
        """

    def start(self) -> Started:
        """Return the parameters and the memory of ``rule`` for one mission."""


@runtime_checkable
class ContactSensor(SignalSensor, Protocol):
    """A type of sensor that feels what touches the robot in a zone at its mount.

    The zone has no height: seen from above, it begins ``depth_m`` behind the mount, goes forward
    without end, and is ``width_m`` wide.
    """

    @property
    def width_m(self) -> float:
        """From its left to its right edge; the mount is in the middle."""

    @property
    def depth_m(self) -> float:
        """How far behind the mount it begins."""


def check_limits(sensor: RangeSensor) -> None:
    """Hold the minimum range below the maximum; for ``__post_init__``.

    Raises:
        InputError: it is not.
    """
    if sensor.range_min_m >= sensor.range_max_m:
        rule = f"must be less than range_max_m ({sensor.range_max_m})"
        raise invalid(sensor, "range_min_m", sensor.range_min_m, rule)


def add_prices(mounts: Iterable[Mount], sensors: Mapping[str, Sensor]) -> float:
    """Return the sum of the prices of mounted sensors."""
    return math.fsum(float(sensors[mount.sensor].price) for mount in mounts)


def sees(sensor: Sensor) -> TypeGuard[RangeSensor]:
    """Whether a sensor casts rays."""
    return sensor.measures == RANGE


def feels(sensor: Sensor) -> TypeGuard[ContactSensor]:
    """Whether a sensor feels contacts."""
    return sensor.measures == CONTACT


def is_signal_sensor(sensor: Sensor) -> TypeGuard[SignalSensor]:
    """Whether a sensor computes its readings from a signal."""
    return sensor.measures in SIGNAL_SIZES


def sensor_bearings(sensor: RangeSensor) -> list[float]:
    """Return the bearing [rad] of the middle of each channel's rays in the sensor's frame."""
    middles = np.zeros((len(sensor.channels), 3))
    np.add.at(middles, sensor.channel_of(), sensor.rays())
    bearings: list[float] = atan2_all(middles[:, 1], middles[:, 0]).tolist()
    return bearings


def name_channels(sensors: Iterable[Sensor]) -> Iterator[str]:
    """Yield the column of each channel of mounted sensors, in their order.

    ``range_N_m`` is the range of sensor N. A sensor with several channels of one name numbers them
    too, as ``range_N_K_m``.
    """
    for index, sensor in enumerate(sensors):
        channels = [(channel.name, channel.unit) for channel in sensor.channels]
        yield from name_readings(index, channels)


def name_readings(index: int, channels: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Yield the columns of a sensor by its number and the name and unit of its channels."""
    sizes = Counter(name for name, _ in channels)
    seen = Counter[str]()
    for name, unit in channels:
        place = f"{index}" if sizes[name] == 1 else f"{index}_{seen[name]}"
        seen[name] += 1
        yield f"{name}_{place}_{unit}" if unit else f"{name}_{place}"
