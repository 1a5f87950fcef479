"""Dead reckoning: a pose estimate that drifts, from odometry and an IMU."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import SPEED, STATE_SIZE, YAW, YAW_RATE, Array, Matrix, X, Y
from evoros.base.checks import TEXT, checked
from evoros.base.compilable import compilable
from evoros.base.errors import InputError
from evoros.controller.protocol import Estimator
from evoros.robot.model import Robot
from evoros.sensor.imu import Imu
from evoros.sensor.odometry import Odometry

FULL_TURN = 2.0 * math.pi


class Parameters(NamedTuple):
    """Constants of the estimator; indices refer to the readings of all sensors."""

    axle: float  # x of the rear axle [m]
    speeds: Array  # index of each odometry sensor's speed; its yaw rate follows
    rates: Array  # index of each IMU's first rate
    verticals: Matrix  # (IMUs, 3), vertical axis in the frame of each IMU


class Memory(NamedTuple):
    """The last estimate, for the centre of the rear axle."""

    time: Array  # (1,) [s], -infinity before the first call
    pose: Array  # (STATE_SIZE,)


@dataclass(frozen=True)
@checked
class DeadReckoning(Estimator):
    """Integrates the speed of the odometry along the integrated yaw rate of the IMU.

    The mission starts at a known pose. Several sensors of a type are averaged; the yaw rate of the
    odometry replaces missing IMU readings. The heading drifts because of the yaw rate's bias.
    """

    odometry: Annotated[str, TEXT] = "odometry"  # name of the sensor type in the design
    imu: Annotated[str | None, TEXT] = "imu"  # sensor type; None: yaw rate from odometry

    def start_estimate(self, robot: Robot, period: float) -> tuple[Parameters, Memory]:
        """Find the readings of odometry and IMUs."""
        speeds = self._find(robot, "odometry", self.odometry, Odometry, period)
        imus = self._find(robot, "imu", self.imu, Imu, period) if self.imu else []
        parameters = Parameters(
            axle=robot.drive.rear_axle_x_m,
            speeds=np.array([robot.layout[mount].start for mount in speeds], dtype=float),
            rates=np.array([robot.layout[mount].start for mount in imus], dtype=float),
            verticals=robot.sensor_frames[imus, 2, :3],
        )
        return parameters, Memory(np.array([-math.inf]), np.zeros(STATE_SIZE))

    def _find(
        self, robot: Robot, field: str, name: str, kind: type[Odometry | Imu], period: float
    ) -> list[int]:
        mounts = [i for i, mount in enumerate(robot.mounts) if mount.sensor == name]
        sensor = robot.sensors.get(name)
        if not mounts or not isinstance(sensor, kind):
            raise InputError(
                f"DeadReckoning.{field}: must be the name of a mounted {kind.__name__}, not "
                f"{name!r}; mount such a sensor in each design, as design=reckoning does, or "
                f"choose controller/localization=exact"
            )
        count = round(sensor.period_s / period)
        if count < 1 or not math.isclose(count * period, sensor.period_s, rel_tol=1e-9):
            raise InputError(
                f"design.sensors.{name}.period_s: must be a whole multiple of controller.period_s "
                f"({period:g} s) for dead reckoning, not {sensor.period_s:g} s; set it to "
                f"{max(1, count) * period:g}"
            )
        return mounts

    @staticmethod
    def rule(
        parameters: Parameters, memory: Memory, readings: Array, pose: Array, time: float
    ) -> None:
        """Move the rear axle along an arc, and compute the pose of the robot's origin."""
        kept, axle = memory.pose, parameters.axle
        if memory.time[0] == -math.inf:
            sin, cos = elementary.sin_cos(pose[YAW])
            kept[X] = pose[X] + axle * cos
            kept[Y] = pose[Y] + axle * sin
            kept[YAW] = pose[YAW]
            memory.time[0] = time
        elapsed = time - memory.time[0]
        memory.time[0] = time
        update_rates(parameters, readings, kept)
        half = 0.5 * kept[YAW_RATE] * elapsed
        chord = kept[SPEED] * elapsed
        if abs(half) > 1e-6:
            chord = chord * elementary.sin(half) / half
        sin, cos = elementary.sin_cos(kept[YAW] + half)
        kept[X] += chord * cos
        kept[Y] += chord * sin
        kept[YAW] += 2.0 * half
        if kept[YAW] > math.pi:
            kept[YAW] -= FULL_TURN
        elif kept[YAW] < -math.pi:
            kept[YAW] += FULL_TURN
        sin, cos = elementary.sin_cos(kept[YAW])
        pose[X] = kept[X] - axle * cos
        pose[Y] = kept[Y] - axle * sin
        pose[YAW] = kept[YAW]
        pose[SPEED] = kept[SPEED]


@compilable
def update_rates(parameters: Parameters, readings: Array, kept: Array) -> None:
    """Store the mean speed [m/s] and yaw rate [rad/s] over all sensors that are not silent."""
    speeds, turns, count = 0.0, 0.0, 0
    for i in range(len(parameters.speeds)):
        place = int(parameters.speeds[i])
        if not math.isnan(readings[place]) and not math.isnan(readings[place + 1]):
            speeds += readings[place]
            turns += readings[place + 1]
            count += 1
    if count > 0:
        kept[SPEED] = speeds / count
        kept[YAW_RATE] = turns / count
    turns, count = 0.0, 0
    for i in range(len(parameters.rates)):
        place = int(parameters.rates[i])
        turn = 0.0
        for axis in range(3):
            turn += parameters.verticals[i, axis] * readings[place + axis]
        if not math.isnan(turn):
            turns += turn
            count += 1
    if count > 0:
        kept[YAW_RATE] = turns / count
