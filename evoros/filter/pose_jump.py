"""A localization that jumps, for example to a place that looks alike."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, NUMBER, checked
from evoros.filter.protocol import ALTERS, Channels, require_pose

INSTEAD = "use it for failure=localization or in the controller's localization, or bias here"


@dataclass(frozen=True)
@checked
class PoseJump:
    """Moves the pose by a distance, and turns it by an angle, from the onset on.

    The yaw is not wrapped: it may pass -pi or pi.
    """

    name: ClassVar[str] = "PoseJump"
    effect: ClassVar[str] = ALTERS
    distance_m: Annotated[float, NOT_NEGATIVE] = 1.0
    direction_deg: Annotated[float | None, NUMBER] = None  # in the world; None: drawn
    yaw_deg: Annotated[float, NUMBER] = 0.0  # left positive

    class Parameters(NamedTuple):
        jump: Array  # of x, y [m], yaw [rad] and speed
        onset: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        """Draw the direction.

        Raises:
            InputError: the channels are not a pose.
        """
        require_pose(channels, "PoseJump", INSTEAD)
        jump = move(self.distance_m, self.direction_deg, self.yaw_deg, rng)
        return self.Parameters(jump, onset)

    @staticmethod
    def rule(parameters: Parameters, values: Array, time: float) -> None:
        """Add the jump."""
        for i in range(len(values)):
            if time >= parameters.onset[i]:
                values[i] += parameters.jump[i]


def move(distance: float, direction_deg: float | None, yaw_deg: float, rng: Generator) -> Array:
    """Return an error of x, y, yaw [rad] and speed; it draws a number in any case."""
    share = float(rng.random())
    angle = 2.0 * math.pi * share if direction_deg is None else math.radians(direction_deg)
    sin, cos = elementary.sin_cos(angle)
    return np.array([distance * cos, distance * sin, math.radians(yaw_deg), 0.0])
