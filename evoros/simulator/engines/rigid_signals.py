"""Signals of sensors without rays, computed from the state of a rigid-body engine."""

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import SPEED, YAW, YAW_RATE, Array, X, Y, product
from evoros.drive.protocol import Drive
from evoros.geometry.shapes import Pose
from evoros.robot.model import Robot
from evoros.sensor import signals as signal
from evoros.sensor.protocol import MOTION, SIGNAL_SIZES, WHEELS
from evoros.simulator.engines.rays import crosses_zone, find_zones


class Motion(NamedTuple):
    """The motion of a robot's root link, in world axes."""

    position: Array  # (3,) [m]
    rotation: Array  # (3, 3), from link to world axes
    velocity: Array  # (3,) [m/s], velocity of the link's origin
    turning: Array  # (3,) [rad/s], angular velocity


class RigidSignals:
    """The signals of a robot, computed from its motion and contacts in the engine."""

    def __init__(self, robot: Robot, gravity: float) -> None:
        starts = [part.start for part in robot.signal_layout]
        kinds = [sensor.measures for sensor in robot.mounted_sensors()]
        mounted = list(zip(starts, kinds, robot.sensor_frames, strict=True))
        self.exist = any(kind in SIGNAL_SIZES for kind in kinds)
        self._gravity = gravity
        self._zones = {starts[index]: zone for index, zone in find_zones(robot).items()}
        self.feels = bool(self._zones)  # whether the engine must report contacts
        self._touches = dict.fromkeys(self._zones, 0.0)
        self._frames = {start: frame for start, kind, frame in mounted if kind == MOTION}
        self._wheels = [start for start, kind, _ in mounted if kind == WHEELS]
        self._rolling = solve_rolling(robot.drive) if self._wheels else np.zeros((2, 0))

    def touch(self, contacts: Iterable[Array]) -> None:
        """Count this step for each touched zone; contacts are points (k, 2) [m] on the robot."""
        # Engines report only the corners of a contact, which covers their hull.
        pieces = [
            (*a, *b)
            for points in contacts
            for a, b in (combinations(points.tolist(), 2) if len(points) > 1 else [[points[0]] * 2])
        ]
        for start, zone in self._zones.items():
            if any(crosses_zone(zone, *piece) for piece in pieces):
                self._touches[start] += 1.0

    def fill(self, signals: Array, motion: Motion, angles: Sequence[float]) -> None:
        """Write all signals; ``angles`` [rad] belong to the drive's wheel joints."""
        for start, frame in self._frames.items():
            self._fill_motion(signals[start:], motion, frame)
        for start in self._wheels:
            distance, turn = product(self._rolling, np.array(angles))
            signals[start + signal.DISTANCE], signals[start + signal.TURN] = distance, turn
        for start, count in self._touches.items():
            signals[start + signal.TOUCHES] = count

    def _fill_motion(self, values: Array, motion: Motion, frame: Array) -> None:
        arm = product(motion.rotation, frame[:3, 3])
        place = tuple((motion.position + arm).tolist())
        pose = Pose.from_matrix(place, product(motion.rotation, frame[:3, :3]))
        x, y, z, w = pose.quaternion
        values[signal.POSITION : signal.ORIENTATION] = place
        values[signal.ORIENTATION : signal.VELOCITY] = w, x, y, z
        values[signal.VELOCITY : signal.TURNING] = motion.velocity + np.cross(motion.turning, arm)
        values[signal.TURNING : signal.GRAVITY] = motion.turning
        values[signal.GRAVITY] = self._gravity


def fill_state(
    state: Array,
    place: Sequence[float],
    quaternion: Sequence[float],
    velocity: Sequence[float],
    yaw_rate: float,
) -> None:
    """Write the motion of a base link in the world, in [m], (x, y, z, w), [m/s] and [rad/s]."""
    qx, qy, qz, qw = quaternion
    yaw = elementary.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    sin, cos = elementary.sin_cos(yaw)
    state[X], state[Y], state[YAW], state[YAW_RATE] = place[0], place[1], yaw, yaw_rate
    state[SPEED] = velocity[0] * cos + velocity[1] * sin


def solve_rolling(drive: Drive) -> Array:
    """Return the matrix (2, wheels) from wheel angles to WHEELS, with zeros for steered wheels."""
    speed, steering = 0.1 * drive.max_speed_mps, 0.5 * drive.steering_limit
    ahead, left, right = (
        np.array(drive.targets(speed, angle)[1]) for angle in (0.0, steering, -steering)
    )
    steered = np.abs(left + right - 2.0 * ahead) > 1e-6 * np.abs(ahead)
    turning = speed * elementary.tan(steering) / drive.wheelbase_m * drive.turn_ratio
    rates = np.column_stack((ahead / speed, (left - ahead) / turning))
    rates[steered] = 0.0
    return np.asarray(np.linalg.pinv(rates))
