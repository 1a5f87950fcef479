"""The sensors of a robot in pictures: fans and colours."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evoros.analysis.tables.readings import find_nearest
from evoros.base.arrays import Array
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.shapes import Pose
from evoros.plugins.recordings.missions import RecordedMission
from evoros.plugins.recordings.video.camera import Pixels, to_matrix
from evoros.plugins.recordings.video.captions import CLEAR, ERRING, FAILED, NEAR
from evoros.plugins.recordings.video.motion import flag_ends, measure_errors
from evoros.sensor.protocol import CONTACT, RAY_DEG
from evoros.storage.figure_context import Beam

SILENT_M = 0.3  # length [m] of a silent sensor's fan
_STATES = np.array([CLEAR, FAILED, NEAR])  # colours by state; fans of later states are drawn on top


@dataclass(frozen=True)
class FieldOfView:
    """The field of view of a range sensor."""

    frame: Array  # (4, 4) in the robot's frame
    half_rad: float  # half of the field of view
    range_m: float


@dataclass(frozen=True, eq=False)
class ShownSensor:
    """A sensor displayed at n times."""

    link: str
    readings: Array  # (n, channels), ranges [m] from right to left
    view: FieldOfView | None  # None for sensors without rays
    states: NDArray[np.int64]  # (n,) indices of ``_STATES``
    colours: Pixels  # (n, 3) colours of the states, blended with the error colour


def make_views(
    robot: Urdf, mission: RecordedMission, times: Array, records: NDArray[np.int64]
) -> Iterator[ShownSensor]:
    """Yield the sensors of a mission at ``times`` (n,) [s]; readings come from ``records``."""
    count = len(mission.sensors)
    ended = flag_ends(times, count, mission.faults)
    errors = measure_errors(times, count, mission.faults)
    for i, sensor in enumerate(mission.sensors):
        kind, readings = sensor.kind, sensor.readings[records]
        nearest = find_nearest(readings)
        if isinstance(kind, Beam):
            half = math.radians(max(kind.fov_deg, RAY_DEG)) / 2
            frame = to_matrix(_level(robot.poses[sensor.link], half))
            view = FieldOfView(frame, half, kind.range_max_m)
            limit = kind.range_max_m / 2 if mission.near_m is None else mission.near_m
            near = nearest < limit
        else:
            view, near = None, (nearest > 0.0) & (kind.measures == CONTACT)
        states = np.where(ended[:, i] | np.isnan(nearest), 1, np.where(near, 2, 0))
        colours = _STATES[states] + errors[:, i, None] * (np.array(ERRING) - _STATES[states])
        painted = np.round(colours).astype(np.uint8)
        yield ShownSensor(sensor.link, readings, view, states, painted)


def _level(pose: Pose, half_rad: float) -> Pose:
    """Return the pose, with its pitch removed if the beam's cone contains a horizontal ray."""
    if abs(math.asin(min(1.0, max(-1.0, float(pose.rotation[2, 0]))))) > half_rad:
        return pose
    return Pose.from_rpy(pose.position, 0.0, 0.0, pose.yaw)
