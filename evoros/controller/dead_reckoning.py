"""Dead reckoning: the pose from odometry and an IMU, which drifts."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.random import Generator

from evoros.base import elementary
from evoros.base.arrays import SPEED, YAW, Array, X, Y
from evoros.base.checks import TEXT, checked
from evoros.base.compilable import compilable
from evoros.base.errors import InputError
from evoros.robot.model import Robot
from evoros.sensor.imu import Imu
from evoros.sensor.odometry import Odometry

FULL_TURN = 2.0 * math.pi

# The parameters, then for each odometry the place of its speed among the readings, and for each IMU
# that of its first rate and the vertical in its axes (3,).
_READINGS, _AXLE_X, _ODOMETRIES, _IMUS, _PLACES = range(5)
_IMU_SIZE = 4

# What the rule remembers, after the readings: the pose of the rear axle, and the last rates.
_STARTED, _TIME, _X, _Y, _YAW, _SPEED, _RATE = range(7)


@dataclass(frozen=True)
@checked
class DeadReckoning:
    """Adds up the speed that odometry tells, along a heading that adds up the IMU's yaw rates.

    The mission starts at a known pose. Each of several sensors of a type counts the same. Without a
    reading of an IMU, the yaw rate is that of the odometry; without one of both, the last values
    stay. The bias of the yaw rate is not known, so the heading drifts.

    Raises:
        InputError: a name that is no text.
    """

    odometry: Annotated[str, TEXT] = "odometry"  # name of the type of sensor in the design
    imu: Annotated[str | None, TEXT] = "imu"  # name of the type; None: the odometry tells the turn
    memory_size: ClassVar[int] = 7

    def start_estimate(self, robot: Robot, period: float) -> Array:
        """Return where the readings are.

        Raises:
            InputError: there is no odometry, or no IMU, on the robot, or one that reads in between.
        """
        speeds = self._find(robot, "odometry", self.odometry, Odometry, period)
        imus = self._find(robot, "imu", self.imu, Imu, period) if self.imu else []
        numbers = [robot.channel_count, robot.drive.rear_axle_x_m, len(speeds), len(imus)]
        numbers += [robot.layout[mount].start for mount in speeds]
        frames = robot.sensor_frames
        for mount in imus:
            numbers += [robot.layout[mount].start, *frames[mount, 2, :3].tolist()]
        return np.array(numbers, dtype=np.float64)

    def _find(
        self, robot: Robot, field: str, name: str, kind: type[Odometry | Imu], period: float
    ) -> list[int]:
        """Return the numbers of the mounts of a type."""
        found = [i for i, mount in enumerate(robot.mounts) if mount.sensor == name]
        sensor = robot.sensors.get(name)
        if not found or not isinstance(sensor, kind):
            raise InputError(
                f"DeadReckoning.{field}: must be the name of a mounted {kind.__name__}, not "
                f"{name!r}; add one to each design, as design=reckoning does, or choose "
                f"controller/localization=exact"
            )
        count = round(sensor.period_s / period)
        if count < 1 or not math.isclose(count * period, sensor.period_s, rel_tol=1e-9):
            raise InputError(
                f"design.sensors.{name}.period_s: must be a whole multiple of controller.period_s "
                f"({period:g} s) for dead reckoning, not {sensor.period_s:g} s; set it to "
                f"{max(1, count) * period:g}"
            )
        return found

    @staticmethod
    def rule(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
        """Move the rear axle along an arc, and place the robot's origin."""
        own = memory[int(parameters[_READINGS]) :]
        axle = parameters[_AXLE_X]
        if own[_STARTED] == 0.0:
            own[_STARTED] = 1.0
            sin, cos = elementary.sin_cos(values[YAW])
            own[_X] = values[X] + axle * cos
            own[_Y] = values[Y] + axle * sin
            own[_YAW] = values[YAW]
            own[_TIME] = time
        own[_SPEED], own[_RATE] = find_rates(parameters, memory, own[_SPEED], own[_RATE])
        half = 0.5 * own[_RATE] * (time - own[_TIME])
        chord = own[_SPEED] * (time - own[_TIME])
        if abs(half) > 1e-6:
            chord = chord * elementary.sin(half) / half
        sin, cos = elementary.sin_cos(own[_YAW] + half)
        own[_X] += chord * cos
        own[_Y] += chord * sin
        own[_YAW] += 2.0 * half
        if own[_YAW] > math.pi:
            own[_YAW] -= FULL_TURN
        elif own[_YAW] < -math.pi:
            own[_YAW] += FULL_TURN
        own[_TIME] = time
        sin, cos = elementary.sin_cos(own[_YAW])
        values[X] = own[_X] - axle * cos
        values[Y] = own[_Y] - axle * sin
        values[YAW] = own[_YAW]
        values[SPEED] = own[_SPEED]


@compilable
def find_rates(
    parameters: Array, readings: Array, speed: float, rate: float
) -> tuple[float, float]:
    """Return the mean speed [m/s] and yaw rate [rad/s] of all sensors, else those of before."""
    odometries = int(parameters[_ODOMETRIES])
    speeds = 0.0
    turns = 0.0
    count = 0
    for i in range(odometries):
        place = int(parameters[_PLACES + i])
        if not math.isnan(readings[place]) and not math.isnan(readings[place + 1]):
            speeds += readings[place]
            turns += readings[place + 1]
            count += 1
    if count > 0:
        speed = speeds / count
        rate = turns / count
    turns = 0.0
    count = 0
    for i in range(int(parameters[_IMUS])):
        first = _PLACES + odometries + _IMU_SIZE * i
        place = int(parameters[first])
        turn = 0.0
        for axis in range(3):
            turn += parameters[first + 1 + axis] * readings[place + axis]
        if not math.isnan(turn):
            turns += turn
            count += 1
    if count > 0:
        rate = turns / count
    return speed, rate
