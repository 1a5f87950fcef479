"""Reads the sensors that a robot's description has for Gazebo."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from lxml.etree import _Element as Element

from evoros.base import elementary
from evoros.base.errors import InputError
from evoros.formats.degrees import LARGEST_RAD
from evoros.formats.pose import parse_pose
from evoros.formats.strict_xml import (
    element_error,
    find_child,
    quote,
    read_number,
    read_positive,
    require_child,
)
from evoros.formats.urdf.noise import read_imu_noise, read_ray_noise
from evoros.geometry.shapes import Pose

LIDAR, SONAR, BUMPER, IMU = "lidar", "sonar", "bumper", "imu"
_RAYS = ("ray", "gpu_ray", "lidar", "gpu_lidar")
_KINDS = {"contact": BUMPER, "imu": IMU, "sonar": SONAR}
_RANGE_PLUGIN = "range"
"""In the file of ROS's plugin that publishes the nearest of all rays as one distance."""
_FULL_TURN = 2.0 * math.pi


@dataclass(frozen=True)
class DescribedSensor:
    """A sensor as its robot's description has it, in evoros's terms."""

    name: str
    kind: str  # LIDAR, SONAR, BUMPER or IMU
    link: str
    pose: Pose  # in the frame of the link
    settings: Mapping[str, float]
    """Those that the description states: ``period_s``, ``range_min_m``, ``range_max_m``,
    ``fov_deg``, ``beams`` and fields of filters, as ``noise.sigma_m``."""
    notes: tuple[str, ...] = ()  # what evoros takes differently


class SensorsRead(NamedTuple):
    """The sensors of a description."""

    sensors: Sequence[DescribedSensor]
    left_out: Sequence[str]  # one line each: which sensor, and why


def read_sensors(robot: Element) -> SensorsRead:
    """Read the ``<sensor>`` elements in the ``<gazebo>`` elements of a ``<robot>``.

    A sensor of a kind that evoros does not have, or whose values make no sense, is left out.
    """
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
        raise element_error(element, "must be on a link", "name it in <gazebo reference=...>")
    placed, settings = find_child(element, "pose"), _read_period(element)
    pose = Pose() if placed is None else parse_pose(placed)
    if given in _RAYS:
        return _read_rays(element, DescribedSensor(name, LIDAR, link, pose, settings))
    if given not in _KINDS:
        problem = f"must be of a type that evoros has, not {quote(given)}"
        raise element_error(element, problem, f"these are {', '.join((*_RAYS, *_KINDS))}")
    notes: tuple[str, ...] = ()
    if given == "sonar":
        settings |= _read_cone(require_child(element, "sonar"))
    if given == "imu":
        noise = read_imu_noise(element)
        settings, notes = {**settings, **noise.settings}, noise.notes
    return DescribedSensor(name, _KINDS[given], link, pose, settings, notes)


def _read_period(element: Element) -> dict[str, float]:
    """Return the period, if the sensor does not measure at each step of Gazebo."""
    rate = find_child(element, "update_rate")
    hertz = 0.0 if rate is None else read_number(rate, "at least 0", lambda value: value >= 0.0)
    return {"period_s": 1.0 / hertz} if hertz > 0.0 else {}


def _read_cone(cone: Element) -> dict[str, float]:
    """Read a ``<sonar>``, whose ``radius`` is its cone's at the maximum range."""
    low, high, radius = (
        read_positive(require_child(cone, name), 1)[0] for name in ("min", "max", "radius")
    )
    _check_order(cone, low, high)
    fov_deg = math.degrees(2.0 * elementary.atan(radius / high))
    return {"range_min_m": low, "range_max_m": high, "fov_deg": fov_deg}


def _read_rays(element: Element, sensor: DescribedSensor) -> DescribedSensor:
    """Read a sensor of rays: a lidar, or a sonar if only the nearest of its hits is published."""
    rays = next((child for tag in ("lidar", "ray") for child in element.iterfind(tag)), None)
    if rays is None:
        raise element_error(element, "must have a <ray> or <lidar>", "add it")
    scan = require_child(rays, "scan")
    beams, low, high = _read_fan(require_child(scan, "horizontal"))
    settings = {**sensor.settings, **_read_limits(require_child(rays, "range"))}
    noise = read_ray_noise(element, rays)
    settings |= noise.settings
    settings["fov_deg"] = math.degrees(min(high - low, _FULL_TURN))
    pose = sensor.pose @ Pose.from_rpy((0.0, 0.0, 0.0), 0.0, 0.0, (low + high) / 2.0)
    plugins = (plugin.get("filename", "") for plugin in element.iterfind("plugin"))
    if any(_RANGE_PLUGIN in filename for filename in plugins):
        return replace(sensor, kind=SONAR, pose=pose, settings=settings, notes=noise.notes)
    vertical = find_child(scan, "vertical")
    layered = vertical is not None and _read_fan(vertical)[0] > 1
    notes = ("has several layers, of which one is taken, level with its frame",) * layered
    if max(high, -low) > LARGEST_RAD:
        notes += (f"has angles from {low:g} to {high:g} rad, as if they were degrees",)
    settings["beams"] = beams
    return replace(sensor, pose=pose, settings=settings, notes=(*notes, *noise.notes))


def _read_fan(fan: Element) -> tuple[int, float, float]:
    """Return the number of rays of a ``<horizontal>`` or ``<vertical>``, and its edges [rad]."""
    samples = read_positive(require_child(fan, "samples"), 1)[0]
    low, high = (
        0.0 if edge is None else read_number(edge, "an angle", math.isfinite)
        for edge in (find_child(fan, "min_angle"), find_child(fan, "max_angle"))
    )
    if high < low:
        problem = f"must have a max_angle of at least its min_angle ({low:g}), not {high:g}"
        raise element_error(fan, problem, "exchange the two")
    return max(1, round(samples)), low, high


def _read_limits(element: Element) -> dict[str, float]:
    low = read_number(require_child(element, "min"), "at least 0", lambda value: value >= 0.0)
    high = read_positive(require_child(element, "max"), 1)[0]
    _check_order(element, low, high)
    return {"range_min_m": low, "range_max_m": high}


def _check_order(element: Element, low: float, high: float) -> None:
    if low >= high:
        problem = f"must have a min below its max ({high:g} m), not {low:g} m"
        raise element_error(element, problem, "correct the two")
