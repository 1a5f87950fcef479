"""Obstacle avoidance that steers into the gap nearest to the goal.

After V. Sezer and M. Gokasan, "A novel obstacle avoidance algorithm: Follow the Gap Method",
Robotics and Autonomous Systems 60(9), 2012, which chooses the widest gap.
"""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base import elementary
from evoros.base.arrays import DRIVE_SPEED, STEERING, TO_X, TO_Y, YAW, Array, X, Y
from evoros.base.checks import NOT_NEGATIVE, POSITIVE, check_order, checked
from evoros.base.compilable import compilable
from evoros.controller.protocol import Layer
from evoros.controller.weighted_voting import require_reach, wrap
from evoros.robot.model import Robot

SHRINK = 0.8  # factor that reduces the range until there is a gap
ROUNDS = 12
DIRECTIONS = 181  # number of evenly spaced headings
WIDEST = math.pi / 2  # [rad], maximum angle between a heading and straight ahead


class Parameters(NamedTuple):
    """The parameters of the rule; ``FollowTheGap`` explains them."""

    range: float  # [m]
    radius: float  # [m]
    centring: float  # [m]
    gain: float
    fast: float  # [m/s]
    slow: float  # [m/s]
    slowing: float  # [m]
    full_lock: float  # [rad]
    yaws: Array  # [rad], one per reading; NaN for sensors without direction


class Memory(NamedTuple):
    """The headings, right to left: 1 if free, 0 if blocked."""

    free: Array


@dataclass(frozen=True)
@checked
class FollowTheGap(Layer):
    """Steers into the gap nearest to the waypoint, and towards the middle of the gap.

    Each reading below ``range_m`` blocks the directions in which a disc of ``radius_m`` would hit
    the obstacle. A gap is a series of free directions within 90 deg of straight ahead; without any,
    the range is reduced. The heading is a mean of two directions in the gap: the direction nearest
    to the waypoint, weighted by the distance to the nearest obstacle, and the middle, weighted by
    ``centring_m``. The speed rises from ``min_speed_mps`` at contact to ``speed_mps`` with
    ``slowing_m`` of free space ahead.
    """

    mode = "avoiding"
    range_m: Annotated[float, POSITIVE] = 2.0
    radius_m: Annotated[float, POSITIVE] = 0.3
    centring_m: Annotated[float, NOT_NEGATIVE] = 0.2
    gain: Annotated[float, POSITIVE] = 1.5  # steering angle [rad] per rad of heading error
    speed_mps: Annotated[float, POSITIVE] = 1.0
    min_speed_mps: Annotated[float, POSITIVE] = 0.1
    slowing_m: Annotated[float, POSITIVE] = 1.0

    def __post_init__(self) -> None:
        check_order(self, "min_speed_mps", "speed_mps")

    def start(self, robot: Robot, period: float, rng: Generator) -> tuple[Parameters, Memory]:
        """Return the parameters, including the directions of the robot's readings."""
        require_reach(self, self.range_m, robot)
        yaws = [yaw if math.isnan(yaw) else wrap(yaw) for yaw in robot.channel_yaws()]
        parameters = Parameters(
            range=self.range_m,
            radius=self.radius_m,
            centring=self.centring_m,
            gain=self.gain,
            fast=self.speed_mps,
            slow=self.min_speed_mps,
            slowing=self.slowing_m,
            full_lock=robot.drive.steering_limit,
            yaws=np.array(yaws, dtype=float),
        )
        return parameters, Memory(np.zeros(DIRECTIONS))

    @staticmethod
    def rule(
        parameters: Parameters,
        memory: Memory,
        state: Array,
        leg: Array,
        readings: Array,
        command: Array,
    ) -> bool:
        """Command the drive if a reading is within range and the pose is known (not NaN)."""
        bearing = elementary.atan2(leg[TO_Y] - state[Y], leg[TO_X] - state[X]) - float(state[YAW])
        nearest = parameters.range
        for i in range(len(readings)):
            if readings[i] < nearest and not math.isnan(parameters.yaws[i]):
                nearest = float(readings[i])
        if math.isnan(bearing) or nearest == parameters.range:
            return False
        goal = (bearing + math.pi) % (2.0 * math.pi) - math.pi
        limit = parameters.range
        heading = math.nan
        for _ in range(ROUNDS):
            block(parameters, memory.free, readings, limit)
            heading = choose(parameters, memory.free, goal, nearest)
            if not math.isnan(heading):
                break
            limit *= SHRINK
        if math.isnan(heading):
            heading = WIDEST if goal > 0.0 else -WIDEST
        ahead = measure_ahead(parameters, readings)
        share = min(max(ahead / parameters.slowing, 0.0), 1.0)
        lock = parameters.full_lock
        command[DRIVE_SPEED] = parameters.slow + share * (parameters.fast - parameters.slow)
        command[STEERING] = min(max(parameters.gain * heading, -lock), lock)
        return True


@compilable
def block(parameters: Parameters, free: Array, readings: Array, limit: float) -> None:
    """Mark as free the directions in which a disc hits no obstacle nearer than ``limit`` [m]."""
    step = 2.0 * WIDEST / (DIRECTIONS - 1)
    for k in range(len(free)):
        free[k] = 1.0
    for i in range(len(readings)):
        reading, yaw = float(readings[i]), float(parameters.yaws[i])
        if not reading < limit or math.isnan(yaw):
            continue
        away = max(reading, 0.0)
        half = math.pi / 2
        if away > parameters.radius:
            leg = math.sqrt(away * away - parameters.radius * parameters.radius)
            half = elementary.atan2(parameters.radius, leg)
        first = max(math.ceil((yaw - half + WIDEST) / step), 0)
        last = min(math.floor((yaw + half + WIDEST) / step), DIRECTIONS - 1)
        for k in range(first, last + 1):
            free[k] = 0.0


@compilable
def choose(parameters: Parameters, free: Array, goal: float, nearest: float) -> float:
    """Return the heading [rad] into the gap nearest to the goal; NaN if there is no gap."""
    step = 2.0 * WIDEST / (DIRECTIONS - 1)
    best, heading = math.inf, math.nan
    first = -1
    for k in range(len(free) + 1):
        inside = k < len(free) and free[k] > 0.0
        if inside and first < 0:
            first = k
        if first >= 0 and not inside:
            low, high = first * step - WIDEST, (k - 1) * step - WIDEST
            near = min(max(goal, low), high)
            if abs(near - goal) < best:
                best = abs(near - goal)
                weight = max(nearest, 0.001)
                middle = 0.5 * (low + high)
                total = weight + parameters.centring
                heading = (weight * near + parameters.centring * middle) / total
            first = -1
    return heading


@compilable
def measure_ahead(parameters: Parameters, readings: Array) -> float:
    """Return the free distance [m] of a disc straight ahead, at most ``slowing``."""
    ahead = parameters.slowing
    for i in range(len(readings)):
        reading, yaw = float(readings[i]), float(parameters.yaws[i])
        if not reading < parameters.slowing + parameters.radius or math.isnan(yaw):
            continue
        sin, cos = elementary.sin_cos(yaw)
        aside, along = reading * sin, reading * cos
        if along > 0.0 and abs(aside) < parameters.radius:
            gone = math.sqrt(parameters.radius * parameters.radius - aside * aside)
            ahead = min(ahead, along - gone)
    return ahead
