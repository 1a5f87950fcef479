"""Waypoint following with a weaving heading, as in the 2018 paper on Evo-ROS."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from numpy.random import Generator

from evoros.base import elementary
from evoros.base.arrays import DRIVE_SPEED, STEERING, TO_X, TO_Y, YAW, Array, X, Y
from evoros.base.checks import POSITIVE, checked
from evoros.controller.protocol import Layer
from evoros.controller.weighted_voting import HALF_TURN
from evoros.robot.model import Robot


@dataclass(frozen=True)
@checked
class Serpentine(Layer):
    """Steers towards the bearing of the waypoint plus a sine of time.

    The steering angle is ``gain`` times the heading error in [-180, 180) deg, limited to full lock.
    Each mission has a random phase. The sweep in the paper is twice ``amplitude_deg``.
    """

    mode = "navigating"
    speed_mps: Annotated[float, POSITIVE] = 0.29
    amplitude_deg: Annotated[float, HALF_TURN] = 30.0
    period_s: Annotated[float, POSITIVE] = 9.7
    gain: Annotated[float, POSITIVE] = 1.5

    class Parameters(NamedTuple):
        speed: float  # [m/s]
        amplitude: float  # [rad]
        frequency: float  # [rad/s]
        phase: float  # [rad]
        gain: float
        full_lock: float  # [rad]

    def start(self, robot: Robot, period: float, rng: Generator) -> Parameters:
        """Draw the phase for a mission."""
        return self.Parameters(
            speed=self.speed_mps,
            amplitude=math.radians(self.amplitude_deg),
            frequency=2.0 * math.pi / self.period_s,
            phase=rng.uniform(0.0, 2.0 * math.pi),
            gain=self.gain,
            full_lock=robot.drive.steering_limit,
        )

    @staticmethod
    def rule(parameters: Parameters, state: Array, leg: Array, time: float, command: Array) -> bool:
        """Command the drive; without a pose (NaN), keep the last command."""
        bearing = elementary.atan2(leg[TO_Y] - state[Y], leg[TO_X] - state[X])
        phase = parameters.frequency * time + parameters.phase
        error = bearing + parameters.amplitude * elementary.sin(phase) - float(state[YAW])
        if math.isnan(error):
            return False
        error = (error + math.pi) % (2.0 * math.pi) - math.pi
        full_lock = parameters.full_lock
        command[DRIVE_SPEED] = parameters.speed
        command[STEERING] = min(max(parameters.gain * error, -full_lock), full_lock)
        return True
