"""A robot's sensors in pictures: fans and colours."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evoros.analysis.tables.readings import RecordedSensor
from evoros.base.arrays import Array
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.shapes import Pose
from evoros.plugins.recordings.video.camera import to_matrix
from evoros.plugins.recordings.video.captions import CLEAR, ERRING, FAILED, NEAR, Colour
from evoros.plugins.recordings.video.motion import Flags
from evoros.sensor.protocol import CONTACT, RAY_DEG
from evoros.storage.figure_context import Beam

SILENT_M = 0.3  # length of a silent sensor's fan


@dataclass(frozen=True)
class FieldOfView:
    """A range sensor's field of view."""

    frame: Array  # (4, 4) in the robot's frame
    half_rad: float  # half the field of view
    range_m: float
    near_m: float  # range below which readings are marked


@dataclass(frozen=True, eq=False)
class ShownSensor:
    """A sensor to show, with its reading in each picture."""

    link: str
    readings: Array  # (n, channels); ranges [m] from right to left
    view: FieldOfView | None  # None for sensors without rays
    touches: bool  # True for a contact sensor, which reads 1 on contact

    def classify(self, index: int) -> Colour:
        """Return the colour of the reading in a picture."""
        readings = self.readings[index]
        nearest = float(np.fmin.reduce(readings))
        if np.isnan(nearest):
            return FAILED
        if self.view is not None:
            return NEAR if nearest < self.view.near_m else CLEAR
        return NEAR if self.touches and nearest > 0.0 else CLEAR


def make_views(
    robot: Urdf, sensors: Sequence[RecordedSensor], records: NDArray[np.int64], near_m: float | None
) -> Iterator[ShownSensor]:
    """Yield the sensors with their readings at ``records``; ``near_m`` None: half of each range."""
    for sensor in sensors:
        kind, readings = sensor.kind, sensor.readings[records]
        if isinstance(kind, Beam):
            half = math.radians(max(kind.fov_deg, RAY_DEG)) / 2
            near = kind.range_max_m / 2 if near_m is None else near_m
            frame = to_matrix(_level(robot.poses[sensor.link], half))
            view = FieldOfView(frame, half, kind.range_max_m, near)
            yield ShownSensor(sensor.link, readings, view, False)
        else:
            yield ShownSensor(sensor.link, readings, None, kind.measures == CONTACT)


def _level(pose: Pose, half_rad: float) -> Pose:
    """Return the pose, levelled if the beam's cone contains a horizontal ray."""
    if abs(math.asin(min(1.0, max(-1.0, float(pose.rotation[2, 0]))))) > half_rad:
        return pose
    return Pose.from_rpy(pose.position, 0.0, 0.0, pose.yaw)


def classify_sensors(sensors: Sequence[ShownSensor], ended: Flags, index: int) -> list[Colour]:
    """Return the colour of each sensor's state; ``ended`` (n, sensors) is True after its end."""
    return [
        FAILED if has_ended else sensor.classify(index)
        for sensor, has_ended in zip(sensors, ended[index], strict=True)
    ]


def colour_sensors(
    sensors: Sequence[ShownSensor], ended: Flags, errors: Array, index: int
) -> list[Colour]:
    """Mix the colours of each sensor's state and error; ``errors`` (n, sensors) is from 0 to 1."""
    states = zip(classify_sensors(sensors, ended, index), errors[index], strict=True)
    return [_mix(state, ERRING, float(share)) for state, share in states]


def _mix(one: Colour, other: Colour, share: float) -> Colour:
    red, green, blue = (round(a + share * (b - a)) for a, b in zip(one, other, strict=True))
    return red, green, blue
