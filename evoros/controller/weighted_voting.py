"""Obstacle avoidance by weighted voting (the 2018 paper on Evo-ROS, section 4, Eq. 2)."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base import elementary
from evoros.base.arrays import DRIVE_SPEED, STEERING, Array
from evoros.base.checks import NOT_NEGATIVE, POSITIVE, Rule, checked, invalid, is_number
from evoros.controller.protocol import Layer
from evoros.robot.model import Robot
from evoros.sensor.protocol import sees

HALF_TURN = Rule("an angle >= 0 and < 180 deg", lambda v: is_number(v) and 0 <= v < 180)
ROUNDING = 1e-9  # [rad], so that a mount at ``ahead_deg`` is ahead despite rounding


@dataclass(frozen=True)
@checked
class WeightedVoting(Layer):
    """Steers by votes: each sensor that detects an obstacle votes for the side it does not face.

    A reading below ``range_m`` is a vote of weight ``range_m - reading``. A sensor that faces right
    or ahead (within ``ahead_deg``, inclusive) votes left; a sensor that faces left votes right. A
    sensor with several beams votes for each side by the nearest reading of its beams on the other
    side. Sensors without rays do not vote. The robot steers towards the larger sum by
    ``|difference| / max_range_m`` of full lock, at most full lock (Eq. 2); with equal sums it
    drives straight. If the sums differ by at most ``deadlock_difference_m`` and both exceed
    ``deadlock_sum_m``, the obstacle is straight ahead, and the robot turns hard left.
    """

    mode = "avoiding"
    range_m: Annotated[float, POSITIVE] = 2.0
    max_range_m: Annotated[float, POSITIVE] = 2.0
    speed_mps: Annotated[float, POSITIVE] = 0.3175
    ahead_deg: Annotated[float, HALF_TURN] = 3.0
    deadlock_difference_m: Annotated[float, NOT_NEGATIVE] = 1.0
    deadlock_sum_m: Annotated[float, NOT_NEGATIVE] = 1.5

    class Parameters(NamedTuple):
        range: float
        max_range: float
        speed: float
        full_lock: float
        deadlock_difference: float
        deadlock_sum: float
        direction: Array  # vote of each reading: 1 left, -1 right, 0 none
        last: Array  # 1 for the last reading of each sensor, else 0

    def start(self, robot: Robot, period: float, rng: Generator) -> Parameters:
        """Return the parameters, including the vote of each reading."""
        require_reach(self, self.range_m, robot)
        ahead = math.radians(self.ahead_deg) + ROUNDING
        votes = [
            0.0 if math.isnan(yaw) else 1.0 if wrap(yaw) <= ahead else -1.0
            for yaw in robot.channel_yaws()
        ]
        last = np.zeros(robot.channel_count)
        last[[part.stop - 1 for part in robot.layout]] = 1.0
        return self.Parameters(
            range=self.range_m,
            max_range=self.max_range_m,
            speed=self.speed_mps,
            full_lock=robot.drive.steering_limit,
            deadlock_difference=self.deadlock_difference_m,
            deadlock_sum=self.deadlock_sum_m,
            direction=np.array(votes, dtype=float),
            last=last,
        )

    @staticmethod
    def rule(parameters: Parameters, readings: Array, command: Array) -> bool:
        """Command the drive if a reading is below ``range``; silent sensors (NaN) do not vote."""
        threshold = parameters.range
        left = right = 0.0
        ahead = aside = threshold  # nearest readings of a sensor that vote left and right
        for i in range(len(readings)):
            reading = float(readings[i])
            if reading < threshold:
                if parameters.direction[i] > 0.0:
                    ahead = min(ahead, reading)
                elif parameters.direction[i] < 0.0:
                    aside = min(aside, reading)
            if parameters.last[i] > 0.0:
                left += threshold - ahead
                right += threshold - aside
                ahead = aside = threshold
        if left == 0.0 and right == 0.0:
            return False
        surplus = left - right
        turn = min(max(surplus / parameters.max_range, -1.0), 1.0)
        balanced = abs(surplus) <= parameters.deadlock_difference
        if balanced and min(left, right) > parameters.deadlock_sum:
            turn = 1.0
        command[DRIVE_SPEED] = parameters.speed
        command[STEERING] = turn * parameters.full_lock
        return True


def require_reach(layer: object, range_m: float, robot: Robot) -> None:
    """Require ``range_m`` to be within each sensor's ``range_max_m``, its reading in free space."""
    ranges = [sensor.range_max_m for sensor in robot.mounted_sensors() if sees(sensor)]
    shortest = min(ranges, default=math.inf)
    if range_m > shortest:
        rule = f"must be at most the sensors' smallest range_max_m, {shortest:g}"
        raise invalid(layer, "range_m", range_m, rule, f"set it to {shortest:g}")


def wrap(angle: float) -> float:
    """Wrap an angle [rad] to [-pi, pi]."""
    return elementary.atan2(*elementary.sin_cos(angle))
