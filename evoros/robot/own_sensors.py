"""The sensors in a robot's description, expressed relative to links that can carry sensors."""

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from typing import Any

from evoros.base import elementary
from evoros.base.errors import InputError
from evoros.formats.urdf.sensors import LIDAR, DescribedSensor, read_sensors
from evoros.formats.urdf.tree import Urdf, read_tree
from evoros.geometry.shapes import Pose
from evoros.robot.model import Robot
from evoros.robot.self_sight import find_seeing_beams, list_spans
from evoros.sensor.lidar import Lidar
from evoros.sensor.protocol import Mount

_ROLL_RAD = 1e-6


@dataclass(frozen=True)
class OwnSensor:
    """A sensor in the description; its pose is rounded to micrometres and 1e-4 degrees."""

    described: DescribedSensor
    link: str  # a link that can carry sensors
    position_m: tuple[float, float, float]  # relative to ``link``
    yaw_deg: float  # left positive
    pitch_deg: float  # nose up positive
    masked: Sequence[tuple[int, int]] = ()  # (first, last) beams that hit the robot itself


@dataclass(frozen=True)
class OwnSensors:
    """The sensors found in a description, with notes on differences from the description."""

    sensors: Sequence[OwnSensor]
    notes: Sequence[str]


def find_own_sensors(robot: Robot) -> OwnSensors:
    """Find the sensors in a robot's description, except those mounted by evoros."""
    read = read_sensors(robot.base_urdf.copy_elements())
    urdf = read_tree((robot.engine_urdf or robot.base_urdf).copy_elements(), robot.name)
    sensors, notes = [], list(read.left_out)
    for described in read.sensors:
        if described.link not in urdf.poses:
            notes.append(
                f"sensor {described.name} is left out, because there is no link {described.link}"
            )
            continue
        sensor, roll = _mount(described, urdf, robot)
        if described.kind == LIDAR:
            with suppress(InputError):  # ``config/own_designs.py`` leaves out invalid lidars
                sensor = replace(sensor, masked=_find_masked(sensor, robot))
        sensors.append(sensor)
        notes += [f"sensor {described.name}: {note}" for note in _describe(sensor, roll)]
    return OwnSensors(sensors, notes)


def _mount(described: DescribedSensor, urdf: Urdf, robot: Robot) -> tuple[OwnSensor, float]:
    """Return the sensor on the nearest link that can carry it, and its roll [rad] there."""
    chain = (described.link, *(joint.parent for joint in urdf.joints_above(described.link)))
    link = next((name for name in chain if name in robot.sensor_links), robot.mount_link)
    pose = urdf.poses[link].inverse() @ urdf.poses[described.link] @ described.pose
    roll, pitch, yaw = _angles(pose)
    x, y, z = (round(length, 6) + 0.0 for length in pose.position)
    yaw_deg, pitch_deg = (round(math.degrees(angle), 4) + 0.0 for angle in (yaw, -pitch))
    return OwnSensor(described, link, (x, y, z), yaw_deg, pitch_deg), roll


def _find_masked(sensor: OwnSensor, robot: Robot) -> list[tuple[int, int]]:
    """Return the (first, last) ranges of lidar beams that hit the robot at some steering angle."""
    known = {field.name for field in fields(Lidar)}
    settings: dict[str, Any] = {k: v for k, v in sensor.described.settings.items() if k in known}
    mount = Mount(LIDAR, sensor.link, *sensor.position_m, sensor.yaw_deg, sensor.pitch_deg)
    (seeing,) = find_seeing_beams(robot.with_sensors([mount], {LIDAR: Lidar(**settings)}))
    return list_spans(seeing)


def _angles(pose: Pose) -> tuple[float, float, float]:
    rotation = pose.rotation
    pitch = elementary.atan2(-rotation[2, 0], math.hypot(rotation[0, 0], rotation[1, 0]))
    roll = elementary.atan2(rotation[2, 1], rotation[2, 2])
    return roll, pitch, elementary.atan2(rotation[1, 0], rotation[0, 0])


def _describe(sensor: OwnSensor, roll: float) -> Iterator[str]:
    yield from sensor.described.notes
    if sensor.link != sensor.described.link:
        yield f"is mounted on {sensor.link}, because {sensor.described.link} cannot carry sensors"
    if abs(roll) > _ROLL_RAD:
        yield f"has a roll of {math.degrees(roll):.1f} deg, which evoros ignores"
