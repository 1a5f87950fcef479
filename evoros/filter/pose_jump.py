"""A localization error that occurs suddenly, for example at a place that looks like another."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, NUMBER, checked
from evoros.filter.protocol import Channels, Filter, require_pose

INSTEAD = (
    "use the filter with failure=localization or in controller.localization, or use bias instead"
)


@dataclass(frozen=True)
@checked
class PoseJump(Filter):
    """Shifts and rotates the pose by given amounts after the onset, without wrapping the yaw."""

    name = "PoseJump"
    distance_m: Annotated[float, NOT_NEGATIVE] = 1.0
    direction_deg: Annotated[float | None, NUMBER] = None  # world frame; None: drawn
    yaw_deg: Annotated[float, NUMBER] = 0.0  # left positive

    class Parameters(NamedTuple):
        jump: Array  # jumps of x, y [m], yaw [rad] and speed
        onset: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        require_pose(channels, "PoseJump", INSTEAD)
        jump = move(self.distance_m, self.direction_deg, self.yaw_deg, rng)
        return self.Parameters(jump, onset)

    @staticmethod
    def rule(parameters: Parameters, values: Array, time: float) -> None:
        for i in range(len(values)):
            if time >= parameters.onset[i]:
                values[i] += parameters.jump[i]


def move(distance: float, direction_deg: float | None, yaw_deg: float, rng: Generator) -> Array:
    """Return an error of x, y [m], yaw [rad] and speed; always draw one random number."""
    share = float(rng.random())
    angle = 2.0 * math.pi * share if direction_deg is None else math.radians(direction_deg)
    sin, cos = elementary.sin_cos(angle)
    return np.array([distance * cos, distance * sin, math.radians(yaw_deg), 0.0])
