"""Waypoint following with a weaving heading, as the 2018 paper on Evo-ROS describes it."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.random import Generator

from evoros.base import elementary
from evoros.base.arrays import (
    DRIVE_SPEED,
    NO_MEMORY,
    STEERING,
    TO_X,
    TO_Y,
    YAW,
    Array,
    RuleArrays,
    X,
    Y,
)
from evoros.base.checks import POSITIVE, Rule, checked, is_number
from evoros.robot.model import Robot

# The rule's parameters.
SPEED, AMPLITUDE, FREQUENCY, PHASE, GAIN, FULL_LOCK = range(6)

AMPLITUDES = Rule("an angle from 0 to less than 180 deg", lambda v: is_number(v) and 0 <= v < 180)


@dataclass(frozen=True)
@checked
class Serpentine:
    """Steers towards the bearing to the waypoint plus a sine of time.

    The steering angle is ``gain`` times the heading error, which is wrapped to [-180, 180) deg, and
    at most full lock. The paper gives a sweep of 60 deg, ``amplitude_deg`` to either side. The
    phase is drawn for each mission.

    Raises:
        InputError: a value is out of range.
    """

    mode: ClassVar[str] = "navigating"
    speed_mps: Annotated[float, POSITIVE] = 0.29
    amplitude_deg: Annotated[float, AMPLITUDES] = 30.0
    period_s: Annotated[float, POSITIVE] = 9.7
    gain: Annotated[float, POSITIVE] = 1.5

    def start(self, robot: Robot, period: float, rng: Generator) -> RuleArrays:
        """Return the parameters with the phase of this mission; no memory."""
        turn = 2.0 * math.pi
        parameters = np.array(
            [
                self.speed_mps,
                math.radians(self.amplitude_deg),
                turn / self.period_s,
                rng.uniform(0.0, turn),
                self.gain,
                robot.drive.steering_limit,
            ]
        )
        return parameters, NO_MEMORY

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
        bearing = elementary.atan2(leg[TO_Y] - state[Y], leg[TO_X] - state[X])
        phase = float(parameters[FREQUENCY]) * time + float(parameters[PHASE])
        error = bearing + float(parameters[AMPLITUDE]) * elementary.sin(phase) - float(state[YAW])
        if math.isnan(error):
            return False
        error = (error + math.pi) % (2.0 * math.pi) - math.pi
        full_lock = float(parameters[FULL_LOCK])
        command[DRIVE_SPEED] = parameters[SPEED]
        command[STEERING] = min(max(float(parameters[GAIN]) * error, -full_lock), full_lock)
        return True
