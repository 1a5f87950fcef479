"""The sensors of a robot in pictures: their fans, and the colours of what they read."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.shapes import Pose
from evoros.sensor.protocol import CONTACT, RAY_DEG
from evoros.storage.figure_context import Beam

from ..tables.readings import RecordedSensor
from .camera import to_matrix
from .captions import CLEAR, ERRING, FAILED, NEAR, Colour
from .faults import Flags

SILENT_M = 0.3
"""The length of the fan of a silent sensor."""


@dataclass(frozen=True)
class FieldOfView:
    """The view of a sensor that casts rays."""

    frame: Array  # (4, 4) in the robot's frame
    half_rad: float  # half its opening
    range_m: float
    near_m: float  # readings below it are marked


@dataclass(frozen=True, eq=False)
class ShownSensor:
    """A sensor that is shown, with its readings at each picture."""

    link: str  # of the robot
    readings: Array  # (n, channels); ranges [m] from the right to the left
    view: FieldOfView | None  # None: it casts no rays
    touches: bool  # whether it reads 1 when something touches the robot

    def classify(self, index: int) -> Colour:
        """Return the colour of what it reads in a picture."""
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
    """Yield the sensors with readings at ``records``; ``near_m`` None: half the range of each."""
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
    """Return a level frame for a beam, as high as wide, with level rays, which meet obstacles."""
    if abs(math.asin(min(1.0, max(-1.0, float(pose.rotation[2, 0]))))) > half_rad:
        return pose
    return Pose.from_rpy(pose.position, 0.0, 0.0, pose.yaw)


def classify_sensors(sensors: Sequence[ShownSensor], ended: Flags, index: int) -> list[Colour]:
    """Return the colour of the state of each sensor's readings in a picture.

    ``ended`` (n, sensors) tells whether its readings have ended.
    """
    return [
        FAILED if has_ended else sensor.classify(index)
        for sensor, has_ended in zip(sensors, ended[index], strict=True)
    ]


def colour_sensors(
    sensors: Sequence[ShownSensor], ended: Flags, errors: Array, index: int
) -> list[Colour]:
    """Return the colour of each sensor in a picture: its state's, mixed with its error's.

    ``errors`` (n, sensors) tells how far its error is shown, from 0 to 1.
    """
    states = classify_sensors(sensors, ended, index)
    return [
        _mix(state, ERRING, float(share))
        for state, share in zip(states, errors[index], strict=True)
    ]


def _mix(one: Colour, other: Colour, share: float) -> Colour:
    """Return a colour between two, with a share (0 to 1) of the other."""
    red, green, blue = (round(a + share * (b - a)) for a, b in zip(one, other, strict=True))
    return red, green, blue
