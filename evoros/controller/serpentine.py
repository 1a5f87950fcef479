"""Waypoint following with a weaving heading, as the 2018 paper on Evo-ROS describes it."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import DRIVE_SPEED, STEERING, TO_X, TO_Y, YAW, Array, X, Y
from evoros.base.checks import POSITIVE, Rule, checked, is_number
from evoros.controller.protocol import LayerRule

if TYPE_CHECKING:
    from evoros.robot.model import Robot

# The rule's parameters.
SPEED, AMPLITUDE, FREQUENCY, PHASE, GAIN, FULL_LOCK = range(6)

AMPLITUDES = Rule("an angle from 0 to less than 180 deg", lambda v: is_number(v) and 0 <= v < 180)


def follow(
    parameters: Array,
    memory: Array,
    state: Array,
    leg: Array,
    readings: Array,
    time: float,
    command: Array,
) -> bool:
    """Decide always, except on a pose that is silent (NaN): then the last command stands."""
    bearing = math.atan2(leg[TO_Y] - state[Y], leg[TO_X] - state[X])
    phase = float(parameters[FREQUENCY]) * time + float(parameters[PHASE])
    error = bearing + float(parameters[AMPLITUDE]) * math.sin(phase) - float(state[YAW])
    if math.isnan(error):
        return False
    error = (error + math.pi) % (2.0 * math.pi) - math.pi
    full_lock = float(parameters[FULL_LOCK])
    command[DRIVE_SPEED] = parameters[SPEED]
    command[STEERING] = min(max(float(parameters[GAIN]) * error, -full_lock), full_lock)
    return True


@dataclass(frozen=True)
@checked
class Serpentine:
    """Steers towards the bearing to the waypoint plus a sine of time.

    The heading error, wrapped to [-180, 180) deg, times ``gain`` is the steering angle, at most
    full lock. The paper gives a sweep of 60 deg, ``amplitude_deg`` to either side; the phase is
    drawn for each mission.

    Raises:
        InputError: a value outside of its range.
    """

    speed_mps: Annotated[float, POSITIVE] = 0.29
    amplitude_deg: Annotated[float, AMPLITUDES] = 30.0
    period_s: Annotated[float, POSITIVE] = 9.7
    gain: Annotated[float, POSITIVE] = 1.5

    @property
    def mode(self) -> str:
        """Following the route."""
        return "navigating"

    @property
    def rule(self) -> LayerRule:
        """Steers to the waypoint."""
        return follow

    def start(self, robot: "Robot", period: float, rng: Generator) -> tuple[Array, Array]:
        """Parameters with this mission's phase; no memory."""
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
        return parameters, np.zeros(0)
