"""Reads the Gazebo sensors of a robot's description, with their noise."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from lxml.etree import _Element as Element

from evoros.base import elementary
from evoros.base.errors import InputError
from evoros.formats import strict_xml as xml
from evoros.formats.notes import LARGEST_RAD
from evoros.geometry.shapes import Pose

GAUSSIAN, NONE = "gaussian", "none"
_DEVIATIONS = ("stddev", "bias_stddev")
_KEPT = ("mean", "bias_mean", *_DEVIATIONS)
_OTHERS = ("precision", "dynamic_bias_stddev", "dynamic_bias_correlation_time")
_NUMBER: tuple[str, Callable[[float], bool]] = ("a number", math.isfinite)
_NOT_NEGATIVE: tuple[str, Callable[[float], bool]] = ("at least 0", lambda value: value >= 0.0)
_QUANTITIES = {
    "rate": ("angular_velocity", "rate"),
    "acceleration": ("linear_acceleration", "accel"),
}
"""Elements of an IMU quantity in new and old files, keyed by the prefix of filter names."""
_AXES = ("x", "y", "z")


class Noise(NamedTuple):
    """Filter settings of a sensor type, keyed ``filter.field``, and notes on unsupported values."""

    settings: Mapping[str, float]
    notes: tuple[str, ...]


def read_ray_noise(*elements: Element) -> Noise:
    """Read Gaussian noise of ranges from the first of several elements that has noise."""
    noises = (xml.find_child(element, "noise") for element in elements)
    noise = next((element for element in noises if element is not None), None)
    if noise is None:
        return Noise({}, ())
    values, lost = _read_values(noise)
    lost += [name for name in _KEPT if name != "stddev" and values.get(name)]
    settings = {"noise.sigma_m": values["stddev"]} if "stddev" in values else {}
    return Noise(settings, _tell(lost, "<noise>"))


def read_imu_noise(sensor: Element) -> Noise:
    """Read the noise and biases of an IMU; the noisiest axis represents all three."""
    imu = xml.find_child(sensor, "imu")
    settings: dict[str, float] = {}
    notes: tuple[str, ...] = ()
    if imu is None:
        return Noise(settings, notes)
    for quantity, (now, before) in _QUANTITIES.items():
        axes = list(_find_axes(imu, now, before))
        if not any(axis is not None for axis in axes):
            continue
        read = [_read_values(axis) for axis in axes]
        lost = [name for _, names in read for name in names]
        lost += ["bias_mean"] * any(values.get("bias_mean") for values, _ in read)
        most = {name: max((v.get(name, 0.0) for v, _ in read), key=abs) for name in _KEPT}
        lost += [
            f"the difference in {name} between axes"
            for name in ("mean", "stddev", "bias_stddev")
            if {v.get(name, 0.0) for v, _ in read} != {most[name]}
        ]
        settings |= {
            f"{quantity}_noise.sigma_m": most["stddev"],
            f"{quantity}_bias.offset_m": most["mean"],
            f"{quantity}_bias.sd_m": math.hypot(most["bias_mean"], most["bias_stddev"]),
        }
        notes += _tell(lost, f"the noise of <{now}>")
    return Noise(settings, notes)


def _find_axes(imu: Element, now: str, before: str) -> Iterator[Element | None]:
    quantity, common = xml.find_child(imu, now), xml.find_child(imu, "noise")
    if quantity is not None:
        axes = (xml.find_child(quantity, axis) for axis in _AXES)
        yield from (None if axis is None else xml.find_child(axis, "noise") for axis in axes)
    elif common is not None:
        yield xml.find_child(common, before)


def _read_values(noise: Element | None) -> tuple[dict[str, float], list[str]]:
    """Return the supported values of a noise element, and the names of other values."""
    if noise is None:
        return {}, []
    kind = xml.find_child(noise, "type")
    given = noise.get("type") or (GAUSSIAN if kind is None else xml.read_text(kind).strip())
    if given == NONE:
        return {}, []
    values = {
        name: xml.read_number(element, *(_NOT_NEGATIVE if name in _DEVIATIONS else _NUMBER))
        for name in (*_KEPT, *_OTHERS)
        if (element := xml.find_child(noise, name)) is not None
    }
    lost = [name for name in _OTHERS if values.pop(name, 0.0)]
    lost += [f"type {given}"] * (given != GAUSSIAN and "precision" not in lost)
    return values, lost


def _tell(lost: Iterable[str], where: str) -> tuple[str, ...]:
    names = list(dict.fromkeys(lost))
    return (f"has settings in {where} that evoros cannot represent: {', '.join(names)}",) * bool(
        names
    )


LIDAR, SONAR, BUMPER, IMU = "lidar", "sonar", "bumper", "imu"
RANGE_FINDER = "multizone"  # sensor type of a range finder with a single ray (one zone)
_RAYS = ("ray", "gpu_ray", "lidar", "gpu_lidar")
_KINDS = {"contact": BUMPER, "imu": IMU, "sonar": SONAR}
_RANGE_PLUGIN = "range"  # part of the file name of ROS's plugin that reports only the nearest hit
_FULL_TURN = 2.0 * math.pi
_LEAST_FIELD = 1e-8  # width [rad] below which a scan is a single ray


@dataclass(frozen=True)
class DescribedSensor:
    """A sensor in a robot's description, with evoros's names of type and values."""

    name: str
    kind: str  # LIDAR, RANGE_FINDER, SONAR, BUMPER or IMU
    link: str
    pose: Pose  # link frame
    settings: Mapping[str, float]  # values by field, such as ``range_max_m`` or ``noise.sigma_m``
    notes: tuple[str, ...] = ()  # differences from the description
    place: str = ""  # file and line


class SensorsRead(NamedTuple):
    """The sensors read from a description, and notes on omitted sensors."""

    sensors: Sequence[DescribedSensor]
    left_out: Sequence[str]  # one line per sensor, with the reason


def read_sensors(robot: Element) -> SensorsRead:
    """Read the ``<sensor>`` elements in the ``<gazebo>`` elements of a ``<robot>``."""
    sensors: list[DescribedSensor] = []
    left_out = []
    for gazebo in robot.iterfind("gazebo"):
        for element in gazebo.iterfind("sensor"):
            try:
                sensors.append(_read_sensor(element, gazebo.get("reference", "").strip()))
            except InputError as error:
                left_out.append(f"left out: {error}")
    return SensorsRead(tuple(sensors), tuple(left_out))


def _read_sensor(element: Element, link: str) -> DescribedSensor:
    given = element.get("type", "").strip()
    name = element.get("name", "").strip() or f"{link}_{given}"
    if not link:
        raise xml.element_error(
            element, "must be on a link", "name the link in <gazebo reference=...>"
        )
    placed, settings = xml.find_child(element, "pose"), _read_period(element)
    pose = Pose() if placed is None else xml.parse_pose(placed)
    sensor = DescribedSensor(name, LIDAR, link, pose, settings, place=xml.place_of(element))
    if given in _RAYS:
        return _read_rays(element, sensor)
    if given not in _KINDS:
        problem = f"must be of a supported type, not {xml.quote(given)}"
        raise xml.element_error(element, problem, f"use {', '.join((*_RAYS, *_KINDS))}")
    notes: tuple[str, ...] = ()
    if given == "sonar":
        settings |= _read_cone(xml.require_child(element, "sonar"))
    if given == "imu":
        noise = read_imu_noise(element)
        settings, notes = {**settings, **noise.settings}, noise.notes
    return replace(sensor, kind=_KINDS[given], settings=settings, notes=notes)


def _read_period(element: Element) -> dict[str, float]:
    """Return ``period_s`` in a dictionary, empty if Gazebo measures in every step."""
    rate = xml.find_child(element, "update_rate")
    hertz = math.inf if rate is None else xml.read_meaning(rate, "sensor/update_rate")
    return {"period_s": 1.0 / hertz} if math.isfinite(hertz) else {}


def _read_cone(cone: Element) -> dict[str, float]:
    """Read a ``<sonar>``; ``radius`` is the radius of its cone at the maximum range."""
    low, high, radius = (
        xml.read_positive(xml.require_child(cone, name), 1)[0] for name in ("min", "max", "radius")
    )
    _check_order(cone, low, high)
    fov_deg = math.degrees(2.0 * elementary.atan(radius / high))
    return {"range_min_m": low, "range_max_m": high, "fov_deg": fov_deg}


def _read_rays(element: Element, sensor: DescribedSensor) -> DescribedSensor:
    """Read a ray sensor: a lidar, or a sonar if only the nearest hit is published."""
    rays = next((child for tag in ("lidar", "ray") for child in element.iterfind(tag)), None)
    if rays is None:
        raise xml.element_error(element, "must have a <ray> or <lidar>", "add it")
    scan = xml.require_child(rays, "scan")
    beams, low, high, notes = _read_fan(xml.require_child(scan, "horizontal"))
    settings = {**sensor.settings, **_read_limits(xml.require_child(rays, "range"))}
    noise = read_ray_noise(element, rays)
    settings |= noise.settings
    told = noise.notes
    if "range_max_m" not in settings:
        told += ("states no maximum range, so the default of the sensor type applies",)
    single = beams == 1 or high - low < _LEAST_FIELD
    # Gazebo Classic ignores the scan angles of a ``ray`` sensor with a single beam.
    ahead = beams == 1 and element.get("type") == "ray"
    middle = 0.0 if ahead else (low + high) / 2.0
    pose = sensor.pose @ Pose.from_rpy((0.0, 0.0, 0.0), 0.0, 0.0, middle)
    plugins = (plugin.get("filename", "") for plugin in element.iterfind("plugin"))
    if single:
        settings |= {"zones": 1, "rays_per_zone": 1}
        return replace(sensor, kind=RANGE_FINDER, pose=pose, settings=settings, notes=told)
    settings["fov_deg"] = math.degrees(min(high - low, _FULL_TURN))
    if any(_RANGE_PLUGIN in filename for filename in plugins):
        return replace(sensor, kind=SONAR, pose=pose, settings=settings, notes=told)
    vertical = xml.find_child(scan, "vertical")
    if vertical is not None and _read_fan(vertical)[0] > 1:
        notes += ("has several layers, but only the level layer is used",)
    if max(high, -low) > LARGEST_RAD:
        notes += (f"has angles from {low:g} to {high:g} rad, which may be in degrees",)
    settings["beams"] = beams
    return replace(sensor, pose=pose, settings=settings, notes=(*notes, *told))


def _read_fan(fan: Element) -> tuple[int, float, float, tuple[str, ...]]:
    """Return the number of ranges of a horizontal or vertical fan, its edges [rad], and notes."""
    # Gazebo interpolates to ``<samples>`` times ``<resolution>`` ranges, rounded down.
    samples = max(1, round(xml.read_positive(xml.require_child(fan, "samples"), 1)[0]))
    resolution = xml.find_child(fan, "resolution")
    scale = 1.0 if resolution is None else xml.read_positive(resolution, 1)[0]
    ranges = max(1, int(samples * scale))
    text = (
        f"casts {samples} rays for {ranges} ranges, because of <resolution>; evoros casts one ray "
        "for each range"
    )
    notes = (text,) * (ranges != samples)
    low, high = (
        0.0 if edge is None else xml.read_number(edge, "an angle", math.isfinite)
        for edge in (xml.find_child(fan, "min_angle"), xml.find_child(fan, "max_angle"))
    )
    if high < low:
        problem = f"has a max_angle ({high:g}) below its min_angle ({low:g})"
        raise xml.element_error(fan, problem, "swap the two")
    return ranges, low, high, notes


def _read_limits(element: Element) -> dict[str, float]:
    low = xml.read_number(xml.require_child(element, "min"), *_NOT_NEGATIVE)
    high = xml.read_meaning(xml.require_child(element, "max"), "range/max")
    _check_order(element, low, high)
    return {"range_min_m": low} | ({"range_max_m": high} if math.isfinite(high) else {})


def _check_order(element: Element, low: float, high: float) -> None:
    if low >= high:
        problem = f"must have a min below its max ({high:g} m), not {low:g} m"
        raise xml.element_error(element, problem, "lower min or raise max")
