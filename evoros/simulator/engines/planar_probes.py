"""The sensors of a robot in the plane that cast no rays, as rows of numbers."""

from typing import NamedTuple

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array, Matrix
from evoros.robot.model import Robot
from evoros.sensor.protocol import CONTACT, MOTION, WHEELS
from evoros.simulator.engines.zones import ZONE_SIZE, find_zones

PLACE = 0
"""Every probe begins with the place of its signal."""
FRAME, GRAVITY = 1, 8
"""A motion probe: the place (3,) [m] and the quaternion (4,) of its frame; gravity [m/s2]."""
MOTION_PROBE_SIZE = 9
ZONE = 1
"""A contact probe: its zone."""
CONTACT_PROBE_SIZE = ZONE + ZONE_SIZE


class Probes(NamedTuple):
    """The sensors of a robot that cast no rays."""

    motion: Matrix  # (p, MOTION_PROBE_SIZE)
    wheels: Array  # the places of the signals
    contact: Matrix  # (p, CONTACT_PROBE_SIZE)


def list_probes(robot: Robot, gravity: float) -> Probes:
    """Return the probes of a robot in a world with a gravity [m/s2]."""
    motion, wheels, contact, zones = [], [], [], find_zones(robot)
    for index, sensor in enumerate(robot.mounted_sensors()):
        place = float(robot.signal_layout[index].start)
        if sensor.measures == MOTION:
            x, y, z, yaw, pitch = robot.sensor_poses[index].tolist()
            motion.append((place, x, y, z, *_face(yaw, pitch), gravity))
        elif sensor.measures == WHEELS:
            wheels.append(place)
        elif sensor.measures == CONTACT:
            contact.append((place, *zones[index]))
    return Probes(
        np.array(motion).reshape(-1, MOTION_PROBE_SIZE),
        np.array(wheels, dtype=np.float64),
        np.array(contact).reshape(-1, CONTACT_PROBE_SIZE),
    )


def _face(yaw: float, pitch: float) -> tuple[float, float, float, float]:
    """Return the quaternion of a yaw to the left and then a pitch, nose up [rad]."""
    sy, cy = elementary.sin_cos(yaw / 2)
    sp, cp = elementary.sin_cos(pitch / 2)
    return cy * cp, sy * sp, -cy * sp, sy * cp
