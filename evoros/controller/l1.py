"""Waypoint following as in ArduPilot: L1 guidance and yaw rate control.

After ``AP_L1_Control`` (S. Park, J. Deyst and J. P. How, "A new nonlinear guidance logic for
trajectory tracking", AIAA 2004-4900) and ``AP_SteerController``. Left is positive.
"""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base import elementary
from evoros.base.arrays import (
    DRIVE_SPEED,
    FROM_X,
    FROM_Y,
    SPEED,
    STEERING,
    TO_X,
    TO_Y,
    YAW,
    YAW_RATE,
    Array,
    X,
    Y,
)
from evoros.base.checks import NOT_NEGATIVE, POSITIVE, checked
from evoros.base.compilable import compilable
from evoros.controller.protocol import Layer
from evoros.robot.model import Robot

STILL = 0.1  # [m/s] and [m], minimum speed and look-ahead distance
CAPTURE = math.sqrt(0.5)  # sine of 45 deg, the steepest angle of approach to the leg
CONVERGED = math.radians(5.0)  # maximum Nu1 at which the crosstrack integral is updated
POINT = 1e-6  # [m], maximum length of a leg without direction
BEYOND = 3.0  # [s], time past the end of a leg after which the robot heads for the end point
DEGREES = 180.0 / math.pi
TURN = 2.0 * math.pi


class Parameters(NamedTuple):
    """Constants of the guidance law and of the yaw rate controller."""

    cruise: float  # [m/s]
    look_ahead: float  # [s], L1 distance per speed
    k_l1: float
    crosstrack_step: float  # gain times control period
    crosstrack_limit: float  # [rad]
    kp: float  # [deg s/rad]
    kd: float  # [s]
    ki_step: float  # gain times control period
    integral_limit: float  # [deg]
    output_limit: float  # [deg]
    lock: float  # [rad/deg], steering angle per output of the yaw rate controller
    min_speed: float  # [m/s]
    interruption: float  # [s], gap between decisions that resets the integrals
    axle: float  # [m], x of the rear axle


class Memory(NamedTuple):
    """Two integrals, the last output and the last time, each (1,)."""

    crosstrack: Array  # [rad]
    integral: Array  # [deg]
    output: Array  # [deg], before clipping
    time: Array  # [s]


@dataclass(frozen=True)
@checked
class L1(Layer):
    """Follows the route as ArduPilot does, by L1 guidance and yaw rate control.

    The law was designed for speeds above ``least_speed_mps``; with a delayed pose, a slow robot
    swings by about 30 deg, as in the 2018 paper (Evo-ROS). The law guides the centre of the rear
    axle, which moves along the heading. A gyroscope provides the yaw rate without delay.
    """

    mode = "navigating"
    speed_mps: Annotated[float, POSITIVE] = 0.29
    period_s: Annotated[float, POSITIVE] = 6.0
    damping: Annotated[float, POSITIVE] = 0.75
    crosstrack_gain: Annotated[float, NOT_NEGATIVE] = 0.02
    crosstrack_limit: Annotated[float, NOT_NEGATIVE] = 0.1
    p: Annotated[float, NOT_NEGATIVE] = 1.8
    i: Annotated[float, NOT_NEGATIVE] = 0.2
    d: Annotated[float, NOT_NEGATIVE] = 0.005
    tau_s: Annotated[float, POSITIVE] = 0.75
    integral_limit_deg: Annotated[float, NOT_NEGATIVE] = 15.0
    output_limit_deg: Annotated[float, POSITIVE] = 45.0
    least_speed_mps: Annotated[float, POSITIVE] = 1.0
    interruption_s: Annotated[float, NOT_NEGATIVE] = 1.0  # pause that resets the integrals

    def start(self, robot: Robot, period: float, rng: Generator) -> tuple[Parameters, Memory]:
        """Return the gains for the control period, and zero integrals."""
        parameters = Parameters(
            cruise=self.speed_mps,
            look_ahead=self.damping * self.period_s / math.pi,
            k_l1=4.0 * self.damping * self.damping,
            crosstrack_step=self.crosstrack_gain * period,
            crosstrack_limit=self.crosstrack_limit,
            kp=max((self.p - self.i * self.tau_s) * self.tau_s - self.d, 0.0) * 45.0,
            kd=4.0 * self.d,
            ki_step=self.i * self.tau_s * 45.0 * period,
            integral_limit=self.integral_limit_deg,
            output_limit=self.output_limit_deg,
            lock=robot.drive.steering_limit / self.output_limit_deg,
            min_speed=self.least_speed_mps,
            # The integrals are obsolete after the avoidance layer has driven for a while.
            interruption=max(self.interruption_s, 1.5 * period),
            axle=robot.drive.rear_axle_x_m,
        )
        return parameters, Memory(np.zeros(1), np.zeros(1), np.zeros(1), np.array([-math.inf]))

    @staticmethod
    def rule(
        parameters: Parameters,
        memory: Memory,
        state: Array,
        leg: Array,
        time: float,
        command: Array,
    ) -> bool:
        """Command the drive; without a pose (NaN), keep the last command."""
        speed = max(float(state[SPEED]), STILL)
        yaw = float(state[YAW])
        sin, cos = elementary.sin_cos(yaw)
        x = float(state[X]) + parameters.axle * cos - float(leg[FROM_X])
        y = float(state[Y]) + parameters.axle * sin - float(leg[FROM_Y])
        if math.isnan(math.sqrt(x * x + y * y) + yaw + speed):
            return False
        if time - memory.time[0] > parameters.interruption:
            memory.crosstrack[0] = memory.integral[0] = memory.output[0] = 0.0
        memory.time[0] = time
        acceleration = guide(parameters, memory, leg, x, y, yaw, speed)
        output = steer(parameters, memory, acceleration, float(state[YAW_RATE]), speed)
        command[DRIVE_SPEED] = parameters.cruise
        command[STEERING] = output * parameters.lock
        return True


@compilable
def guide(
    parameters: Parameters, memory: Memory, leg: Array, x: float, y: float, yaw: float, speed: float
) -> float:
    """Return the lateral acceleration [m/s2] that guides the point (x, y) [m] to the leg.

    The point is relative to the start of the leg. (aim_x, aim_y) is the direction to aim for, and
    nu1 the correction angle towards the leg.
    """
    distance = math.sqrt(x * x + y * y)
    look_ahead = parameters.look_ahead * speed
    aim_x = float(leg[TO_X]) - float(leg[FROM_X])
    aim_y = float(leg[TO_Y]) - float(leg[FROM_Y])
    length = math.sqrt(aim_x * aim_x + aim_y * aim_y)
    along = (x * aim_x + y * aim_y) / max(length, POINT)
    nu1 = 0.0
    if distance > look_ahead and along < -CAPTURE * max(distance, 1.0):
        aim_x, aim_y = -x, -y
    elif along > length + BEYOND * speed or length < POINT:
        aim_x, aim_y = aim_x - x, aim_y - y
    else:
        left_of_leg = (aim_x * y - aim_y * x) / length
        sine = -left_of_leg / max(look_ahead, STILL)
        nu1 = elementary.asin(min(max(sine, -CAPTURE), CAPTURE))
        if abs(nu1) < CONVERGED:
            limit = parameters.crosstrack_limit
            integral = float(memory.crosstrack[0]) + parameters.crosstrack_step * nu1
            memory.crosstrack[0] = min(max(integral, -limit), limit)
        nu1 += float(memory.crosstrack[0])
    nu2 = (elementary.atan2(aim_y, aim_x) - yaw + math.pi) % TURN - math.pi
    nu = min(max(nu1 + nu2, -0.5 * math.pi), 0.5 * math.pi)
    return parameters.k_l1 * speed * speed / look_ahead * elementary.sin(nu)


@compilable
def steer(
    parameters: Parameters, memory: Memory, acceleration: float, yaw_rate: float, speed: float
) -> float:
    """Return the output [deg] of the yaw rate controller for a lateral acceleration [m/s2]."""
    # ArduPilot also has the error in degrees per second, but the demand in radians per second.
    scale = 1.0 / max(speed, parameters.min_speed)
    rate = acceleration * scale
    error = (rate - yaw_rate) * DEGREES * scale
    step = error * parameters.ki_step * scale
    limit = parameters.output_limit
    last = float(memory.output[0])
    if last < -limit:  # anti-windup: at a limit, the integral may only decrease in magnitude
        step = max(step, 0.0)
    elif last > limit:
        step = min(step, 0.0)
    bound = parameters.integral_limit
    integral = min(max(float(memory.integral[0]) + step, -bound), bound)
    output = error * parameters.kd + rate * parameters.kp * scale + integral
    memory.integral[0], memory.output[0] = integral, output
    return min(max(output, -limit), limit)
