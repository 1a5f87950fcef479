"""Base classes of sensors and mounts, and names of mounted sensors (``sonar_0``) and readings."""

import math
import re
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple, TypeGuard

import numpy as np
from numpy.typing import NDArray

from evoros.base import checks
from evoros.base.arrays import Array
from evoros.compilation.elementary_arrays import atan2_all
from evoros.compilation.named_rules import Started, start_part
from evoros.filter.protocol import FILTERS, Filter

_PREFIX = "evoros_"


def choose_prefix(taken: Iterable[str], types: Collection[str]) -> str:
    """Return the shortest prefix that keeps names of these sensor types out of ``taken``."""
    return _PREFIX * (_highest_level(taken, types) + 1)


def find_prefix(links: Iterable[str], types: Collection[str]) -> str:
    """Return the prefix of these sensor types on a robot with these ``links``."""
    return _PREFIX * max(_highest_level(links, types), 0)


def _highest_level(names: Iterable[str], types: Collection[str]) -> int:
    """Return the maximum number of prefixes before sensor names in ``names``; -1 if none match."""
    pattern = rf"((?:{_PREFIX})*)(?:{'|'.join(map(re.escape, types))})_[0-9]+(?:_joint)?"
    matches = (re.fullmatch(pattern, name) for name in names) if types else ()
    return max((len(match[1]) // len(_PREFIX) for match in matches if match), default=-1)


@dataclass(frozen=True)
class Mount:
    """A mounted sensor: its type, and its pose in the frame of ``link``."""

    sensor: str  # sensor type, a key of ``sensors`` in the design
    link: str  # robot link that carries the sensor
    x_m: float  # forward
    y_m: float  # left
    z_m: float  # up
    yaw_deg: float  # left positive
    pitch_deg: float  # nose up positive

    @property
    def pose(self) -> tuple[float, float, float, float, float]:
        """The position [m], yaw and pitch [deg]."""
        return self.x_m, self.y_m, self.z_m, self.yaw_deg, self.pitch_deg


BOX = checks.Rule(
    "a list of three positive lengths",
    lambda v: isinstance(v, list | tuple) and len(v) == 3 and all(map(checks.POSITIVE.holds, v)),
)
BEAM = checks.Rule(
    "an angle greater than 0 and less than 180", lambda v: checks.is_number(v) and 0 < v < 180
)
RAY_DEG = 1.0  # coverage [deg] of a ray or a narrower beam, which figures show as a line
RANGE, MOTION, WHEELS, CONTACT = "range", "motion", "wheels", "contact"
"""Quantities measured by sensors: range, motion of the mount, rolling of wheels, contact."""
SIGNAL_SIZES = {MOTION: 14, WHEELS: 2, CONTACT: 1}  # values per signal; see ``signals``
SENSOR_ARGUMENTS = "parameters", "memory", "rng", "signal", "values", "time"
"""Possible arguments of a signal sensor's ``rule``, which fills ``values`` at ``time`` [s]."""


class Channel(NamedTuple):
    """The name, unit and limits of one value in a sensor's reading."""

    name: str  # quantity, used as a column prefix, such as range
    unit: str  # unit, used as a column suffix, such as m; empty if dimensionless
    low: float  # minimum reading; -inf if unlimited
    high: float  # maximum reading; range sensors return it if nothing is in range


class Sensor(ABC):
    """A sensor type: measured quantity, channels, period, filters and body."""

    period_s: float  # time [s] between readings
    measures: str  # measured quantity: ``range`` for a ``RangeSensor``, otherwise a signal
    filters: Mapping[str, Filter] = MappingProxyType({})  # keyed by name; in order, noise first
    size_m: Sequence[float]  # side lengths (3,) [m] of a centred box that never collides
    mass_kg: float  # mass [kg] of the body, positive because simulators drop massless bodies
    price: float = 0.0  # price, at least 0, in any unit

    @property
    @abstractmethod
    def channels(self) -> Sequence[Channel]:
        """The channels of a reading, at least one."""

    def gazebo(self, name: str) -> str:
        """Return the SDF ``<sensor>`` for the champion's URDF; empty if Gazebo cannot model it."""
        return ""


class RangeSensor(Sensor):
    """A sensor type that measures distances along rays; see ``find_field`` about ``fov_deg``."""

    measures = RANGE
    radiation: str = ""  # radiation type in ROS messages: ``infrared``, or empty for ultrasound
    range_min_m: float  # minimum reading [m]
    range_max_m: float  # maximum reading [m], also returned if nothing is in range

    def __post_init__(self) -> None:
        if self.range_min_m >= self.range_max_m:
            rule = f"must be less than range_max_m ({self.range_max_m})"
            raise checks.invalid(self, "range_min_m", self.range_min_m, rule)

    @property
    def channels(self) -> Sequence[Channel]:
        """A range channel for each channel in ``channel_of``."""
        count = int(np.max(self.channel_of())) + 1
        return (Channel("range", "m", self.range_min_m, self.range_max_m),) * count

    @abstractmethod
    def rays(self) -> Array:
        """Return unit vectors (k, 3) in the sensor's frame, x forward."""

    @abstractmethod
    def channel_of(self) -> NDArray[np.int64]:
        """Return the channel (k,) of each ray; a channel reads the nearest hit of its rays."""


class SignalSensor(Sensor):
    """A sensor type that computes its readings from a signal instead of ranges."""

    rule: Callable[..., None]  # static; takes some of ``SENSOR_ARGUMENTS``, fills ``values``

    @abstractmethod
    def start(self) -> Started:
        """Return the parameters and the memory of ``rule`` for one mission."""


class ContactSensor(SignalSensor):
    """A sensor type that detects contacts of the robot in a zone near its mount, at any height.

    In top view, the zone is ``width_m`` wide, begins ``depth_m`` behind the mount, and extends
    forward without limit.
    """

    measures = CONTACT
    width_m: float  # distance [m] between the zone's edges, centred on the mount
    depth_m: float  # distance [m] from the mount back to the start of the zone


def _are_channels(value: object) -> bool:
    channels = value if isinstance(value, list | tuple) else ()
    return bool(channels) and all(
        isinstance(one, Channel)
        and all(isinstance(text, str) for text in one[:2])
        and all(isinstance(limit, int | float) for limit in one[2:])
        and one.low <= one.high
        for one in channels
    )


def _are_rays(value: object) -> bool:
    if not isinstance(value, np.ndarray) or value.dtype != np.float64 or value.shape[1:] != (3,):
        return False
    lengths = np.sqrt((value * value).sum(axis=1))
    return len(lengths) > 0 and bool(np.all(np.abs(lengths - 1.0) < 1e-6))


RULES = {
    "period_s": checks.POSITIVE,
    "measures": checks.TEXT,
    "channels": checks.Rule(
        "a list of Channel(name, unit, low, high) with low <= high", _are_channels
    ),
    "filters": FILTERS,
    "size_m": BOX,
    "mass_kg": checks.POSITIVE,
    "price": checks.NOT_NEGATIVE,
}
RAYS = checks.Rule("a float64 array (k, 3) of unit vectors, with k >= 1", _are_rays)


def check_sensor(sensor: Sensor) -> None:
    """Raise an InputError if a sensor type, possibly user-defined, breaks a rule."""
    checks.require(sensor, RULES)
    element = checks.Rule("an SDF element as a string", lambda v: isinstance(v, str))
    checks.ask("", sensor.gazebo, element, "sensor")
    if is_signal_sensor(sensor):
        start_part(sensor.start)
    if not sees(sensor):
        return
    checks.require(sensor, {"range_min_m": checks.NOT_NEGATIVE, "range_max_m": checks.POSITIVE})
    rays, last = len(checks.ask("", sensor.rays, RAYS)), len(sensor.channels) - 1

    def are_channels(value: Any) -> bool:
        whole = isinstance(value, np.ndarray) and value.dtype.kind == "i" and value.shape == (rays,)
        return whole and value.min() >= 0 and bool(value.max() <= last)

    text = f"an array ({rays},) of integers from 0 to {last}, the channel of each ray"
    checks.ask("", sensor.channel_of, checks.Rule(text, are_channels))


def add_prices(mounts: Iterable[Mount], sensors: Mapping[str, Sensor]) -> float:
    """Return the total price of mounted sensors."""
    return math.fsum(float(sensors[mount.sensor].price) for mount in mounts)


def sees(sensor: Sensor) -> TypeGuard[RangeSensor]:
    """Return True if a sensor casts rays."""
    return sensor.measures == RANGE


def feels(sensor: Sensor) -> TypeGuard[ContactSensor]:
    """Return True if a sensor detects contacts."""
    return sensor.measures == CONTACT


def is_signal_sensor(sensor: Sensor) -> TypeGuard[SignalSensor]:
    """Return True if a sensor computes its readings from a signal."""
    return sensor.measures in SIGNAL_SIZES


def find_field(sensor: RangeSensor) -> tuple[float, float]:
    """Return the right and left edges [rad] of a sensor's field of view in its x-y plane.

    The field is ``fov_deg`` wide. Without ``fov_deg``, it lies between the outermost rays, or is
    the full circle if these leave no gap behind the sensor. A single ray has no width.
    """
    rays = np.asarray(sensor.rays())
    azimuths = np.unique(atan2_all(rays[:, 1], rays[:, 0]))
    low, high = float(azimuths[0]), float(azimuths[-1])
    if len(rays) == 1:
        return low, high
    if hasattr(sensor, "fov_deg"):
        half = math.radians(sensor.fov_deg) / 2
        return -half, half
    behind = low + 2 * math.pi - high
    if behind <= 1.5 * float(np.diff(azimuths).max(initial=0.0)) and behind < math.pi / 2:
        return -math.pi, math.pi
    return low, high


def sensor_bearings(sensor: RangeSensor) -> list[float]:
    """Return the bearing [rad] of each channel, from its mean ray direction."""
    middles = np.zeros((len(sensor.channels), 3))
    np.add.at(middles, sensor.channel_of(), sensor.rays())
    bearings: list[float] = atan2_all(middles[:, 1], middles[:, 0]).tolist()
    return bearings


def name_channels(sensors: Iterable[Sensor]) -> Iterator[str]:
    """Yield the columns of the channels: ``range_N_m``, or ``range_N_K_m`` if there are several."""
    for index, sensor in enumerate(sensors):
        yield from name_readings(index, [channel[:2] for channel in sensor.channels])


def name_readings(index: int, channels: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Yield the column names of a sensor from its index and its channels (name, unit)."""
    sizes = Counter(name for name, _ in channels)
    seen = Counter[str]()
    for name, unit in channels:
        place = f"{index}" if sizes[name] == 1 else f"{index}_{seen[name]}"
        seen[name] += 1
        yield f"{name}_{place}_{unit}" if unit else f"{name}_{place}"


def spread_bearings(count: int, width_deg: float, spaces: int) -> Array:
    """Return ``count`` bearings [rad], left positive, spaced by ``width_deg / spaces``."""
    half_space = math.radians(width_deg) / spaces / 2
    # unlike linspace, this makes mirrored bearings bitwise opposite
    return np.asarray(np.arange(1.0 - count, count, 2.0) * half_space)
