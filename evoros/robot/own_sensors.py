"""The sensors that a robot's description already has, on the links that can carry sensors."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from evoros.base import elementary
from evoros.formats.urdf.sensors import DescribedSensor, read_sensors
from evoros.formats.urdf.tree import Urdf, read_tree
from evoros.geometry.shapes import Pose
from evoros.robot.model import Robot

_ROLL_RAD = 1e-6


@dataclass(frozen=True)
class OwnSensor:
    """A sensor of the description with its place, rounded to micrometres and 1e-4 degrees."""

    described: DescribedSensor
    link: str  # one that can carry sensors
    position_m: tuple[float, float, float]  # in the frame of ``link``
    yaw_deg: float  # left positive
    pitch_deg: float  # nose up positive


@dataclass(frozen=True)
class OwnSensors:
    """The sensors of a description, and a line for each thing that is taken differently."""

    sensors: Sequence[OwnSensor]
    notes: Sequence[str]


def find_own_sensors(robot: Robot) -> OwnSensors:
    """Find the sensors in the description of ``robot``, which evoros itself does not mount."""
    read = read_sensors(robot.base_urdf.copy_elements())
    urdf = read_tree((robot.engine_urdf or robot.base_urdf).copy_elements(), robot.name)
    sensors, notes = [], list(read.left_out)
    for described in read.sensors:
        if described.link not in urdf.poses:
            notes.append(f"left out: sensor {described.name}: there is no link {described.link}")
            continue
        sensor, roll = _mount(described, urdf, robot)
        sensors.append(sensor)
        notes += [f"sensor {described.name}: {note}" for note in _describe(sensor, roll)]
    return OwnSensors(sensors, notes)


def _mount(described: DescribedSensor, urdf: Urdf, robot: Robot) -> tuple[OwnSensor, float]:
    """Return the sensor on the nearest link that can carry it, and its roll there [rad]."""
    chain = (described.link, *(joint.parent for joint in urdf.joints_above(described.link)))
    link = next((name for name in chain if name in robot.sensor_links), robot.mount_link)
    pose = urdf.poses[link].inverse() @ urdf.poses[described.link] @ described.pose
    roll, pitch, yaw = _angles(pose)
    x, y, z = (round(length, 6) + 0.0 for length in pose.position)
    yaw_deg, pitch_deg = (round(math.degrees(angle), 4) + 0.0 for angle in (yaw, -pitch))
    return OwnSensor(described, link, (x, y, z), yaw_deg, pitch_deg), roll


def _angles(pose: Pose) -> tuple[float, float, float]:
    """Return roll, pitch and yaw about fixed axes [rad]."""
    rotation = pose.rotation
    pitch = elementary.atan2(-rotation[2, 0], math.hypot(rotation[0, 0], rotation[1, 0]))
    roll = elementary.atan2(rotation[2, 1], rotation[2, 2])
    return roll, pitch, elementary.atan2(rotation[1, 0], rotation[0, 0])


def _describe(sensor: OwnSensor, roll: float) -> Iterator[str]:
    """Yield the differences between the sensor in evoros and in the description."""
    yield from sensor.described.notes
    if sensor.link != sensor.described.link:
        yield f"is mounted on {sensor.link}, because {sensor.described.link} can carry none"
    if abs(roll) > _ROLL_RAD:
        yield f"is rolled by {math.degrees(roll):.1f} deg, which evoros takes as level"
