"""Waypoint following by ArduPilot's law: L1 guidance, then steering at a demanded yaw rate.

The guidance is that of ArduPilot's ``AP_L1_Control``, after S. Park, J. Deyst and J. P. How, "A
new nonlinear guidance logic for trajectory tracking", AIAA 2004-4900; the steering is that of its
``AP_SteerController``. Here left is positive.
"""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

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
    RuleArrays,
    X,
    Y,
)
from evoros.base.checks import NOT_NEGATIVE, POSITIVE, checked
from evoros.base.compilable import compilable
from evoros.robot.model import Robot

# The rule's parameters: a yaw rate [rad/s] becomes an output [deg], and LOCK makes it steering.
(
    CRUISE,  # [m/s]
    LOOK_AHEAD,  # L1 for each m/s of speed [s]
    K_L1,
    CROSSTRACK_STEP,  # gain times control period
    CROSSTRACK_LIMIT,  # [rad]
    KP,  # [deg s/rad]
    KD,  # [s]
    KI_STEP,  # gain times control period
    INTEGRAL_LIMIT,  # [deg]
    OUTPUT_LIMIT,  # [deg]
    LOCK,  # [rad/deg]
    MIN_SPEED,  # [m/s]
    INTERRUPTION,  # [s]
    AXLE,  # [m]
) = range(14)

# The rule's memory.
CROSSTRACK, INTEGRAL, LAST_OUTPUT, LAST_TIME = range(4)
"""The integrals [rad, deg], the output before its limit [deg], the time [s] of the last call."""

STILL = 0.1  # [m/s], [m]: below, the speed and the look-ahead distance mean nothing
CAPTURE = math.sqrt(0.5)  # sine of 45 deg, the steepest approach to the leg
CONVERGED = math.radians(5.0)  # the crosstrack integral waits for Nu1 to be smaller
POINT = 1e-6  # [m]: a shorter leg has no direction
BEYOND = 3.0  # [s]: this far past the leg's end, the end itself leads
DEGREES = 180.0 / math.pi
TURN = 2.0 * math.pi


@dataclass(frozen=True)
@checked
class L1:
    """ArduPilot's route following, with the names of its parameters at the fields.

    The law was made for speeds above ``least_speed_mps``. On a slow robot with a late pose the
    heading swings by some 30 deg, which is the serpentine of the 2018 paper (Evo-ROS); with an
    exact pose the robot goes straight. The yaw rate is a gyroscope's, which no localization delays.
    The law leads the centre of the rear axle along the route, because that point moves as the robot
    heads; a point ahead of it would notice every turn before the robot has made it.

    Raises:
        InputError: a value is out of range.
    """

    mode: ClassVar[str] = "navigating"
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
    interruption_s: Annotated[float, NOT_NEGATIVE] = 1.0  # after which the integrals start afresh

    def start(self, robot: Robot, period: float, rng: Generator) -> RuleArrays:
        """Return the gains for this control period, and empty integrals as memory."""
        parameters = np.zeros(AXLE + 1)
        parameters[CRUISE] = self.speed_mps
        parameters[LOOK_AHEAD] = self.damping * self.period_s / math.pi
        parameters[K_L1] = 4.0 * self.damping * self.damping
        parameters[CROSSTRACK_STEP] = self.crosstrack_gain * period
        parameters[CROSSTRACK_LIMIT] = self.crosstrack_limit
        parameters[KP] = max((self.p - self.i * self.tau_s) * self.tau_s - self.d, 0.0) * 45.0
        parameters[KD] = 4.0 * self.d
        parameters[KI_STEP] = self.i * self.tau_s * 45.0 * period
        parameters[INTEGRAL_LIMIT] = self.integral_limit_deg
        parameters[OUTPUT_LIMIT] = self.output_limit_deg
        parameters[LOCK] = robot.drive.steering_limit / self.output_limit_deg
        parameters[MIN_SPEED] = self.least_speed_mps
        # The integrals are out of date once avoidance has driven for a while.
        parameters[INTERRUPTION] = max(self.interruption_s, 1.5 * period)
        parameters[AXLE] = robot.drive.rear_axle_x_m
        memory = np.zeros(LAST_TIME + 1)
        memory[LAST_TIME] = -math.inf
        return parameters, memory

    @staticmethod
    def rule(
        parameters: Array,
        memory: Array,
        state: Array,
        leg: Array,
        readings: Array,
        time: float,
        command: Array,
    ) -> bool:
        """Decide always, except if the pose is silent (NaN): the last command stands then."""
        speed = max(float(state[SPEED]), STILL)
        yaw = float(state[YAW])
        axle = float(parameters[AXLE])
        sin, cos = elementary.sin_cos(yaw)
        x = float(state[X]) + axle * cos - float(leg[FROM_X])
        y = float(state[Y]) + axle * sin - float(leg[FROM_Y])
        if math.isnan(math.sqrt(x * x + y * y) + yaw + speed):
            return False
        if time - float(memory[LAST_TIME]) > float(parameters[INTERRUPTION]):
            memory[CROSSTRACK] = 0.0
            memory[INTEGRAL] = 0.0
            memory[LAST_OUTPUT] = 0.0
        memory[LAST_TIME] = time
        acceleration = guide(parameters, memory, leg, x, y, yaw, speed)
        output = steer(parameters, memory, acceleration, float(state[YAW_RATE]), speed)
        command[DRIVE_SPEED] = parameters[CRUISE]
        command[STEERING] = output * float(parameters[LOCK])
        return True


@compilable
def guide(
    parameters: Array, memory: Array, leg: Array, x: float, y: float, yaw: float, speed: float
) -> float:
    """Return the lateral acceleration [m/s2] that leads the point (x, y) [m] to the leg.

    The point is relative to the leg's start. (aim_x, aim_y) is where to go, and nu1 the angle by
    which the leg attracts the point.
    """
    distance = math.sqrt(x * x + y * y)
    look_ahead = float(parameters[LOOK_AHEAD]) * speed
    aim_x = float(leg[TO_X]) - float(leg[FROM_X])
    aim_y = float(leg[TO_Y]) - float(leg[FROM_Y])
    length = math.sqrt(aim_x * aim_x + aim_y * aim_y)
    along = (x * aim_x + y * aim_y) / max(length, POINT)
    nu1 = 0.0
    if distance > look_ahead and along < -CAPTURE * max(distance, 1.0):
        aim_x = -x
        aim_y = -y
    elif along > length + BEYOND * speed or length < POINT:
        aim_x = aim_x - x
        aim_y = aim_y - y
    else:
        left_of_leg = (aim_x * y - aim_y * x) / length
        sine = -left_of_leg / max(look_ahead, STILL)
        nu1 = elementary.asin(min(max(sine, -CAPTURE), CAPTURE))
        if abs(nu1) < CONVERGED:
            limit = float(parameters[CROSSTRACK_LIMIT])
            integral = float(memory[CROSSTRACK]) + float(parameters[CROSSTRACK_STEP]) * nu1
            memory[CROSSTRACK] = min(max(integral, -limit), limit)
        nu1 += float(memory[CROSSTRACK])
    nu2 = (elementary.atan2(aim_y, aim_x) - yaw + math.pi) % TURN - math.pi
    nu = min(max(nu1 + nu2, -0.5 * math.pi), 0.5 * math.pi)
    return float(parameters[K_L1]) * speed * speed / look_ahead * elementary.sin(nu)


@compilable
def steer(
    parameters: Array, memory: Array, acceleration: float, yaw_rate: float, speed: float
) -> float:
    """Return the output [deg] of the yaw rate's controller for a lateral acceleration [m/s2].

    ArduPilot mixes units: the error is in degrees per second, the demand in radians per second.
    """
    scale = 1.0 / max(speed, float(parameters[MIN_SPEED]))
    rate = acceleration * scale
    error = (rate - yaw_rate) * DEGREES * scale
    step = error * float(parameters[KI_STEP]) * scale
    limit = float(parameters[OUTPUT_LIMIT])
    last = float(memory[LAST_OUTPUT])
    if last < -limit:  # at its limit, the integral may only bring the output back
        step = max(step, 0.0)
    elif last > limit:
        step = min(step, 0.0)
    integral_limit = float(parameters[INTEGRAL_LIMIT])
    integral = min(max(float(memory[INTEGRAL]) + step, -integral_limit), integral_limit)
    output = error * float(parameters[KD]) + rate * float(parameters[KP]) * scale + integral
    memory[INTEGRAL] = integral
    memory[LAST_OUTPUT] = output
    return min(max(output, -limit), limit)
