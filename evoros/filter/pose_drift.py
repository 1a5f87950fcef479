"""A localization error that increases with time, as in dead reckoning."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, NUMBER, POSITIVE, checked
from evoros.filter.pose_jump import INSTEAD, move
from evoros.filter.protocol import GROWS, Channels, Filter, require_pose


@dataclass(frozen=True)
@checked
class PoseDrift(Filter):
    """Shifts and rotates the pose at a constant rate after the onset, without wrapping the yaw."""

    name = "PoseDrift"
    effect = GROWS
    rate_mps: Annotated[float, NOT_NEGATIVE] = 0.02
    direction_deg: Annotated[float | None, NUMBER] = None  # world frame; None: drawn
    yaw_rate_dps: Annotated[float, NUMBER] = 0.0  # [deg/s], left positive
    longest_s: Annotated[float | None, POSITIVE] = None  # duration of the increase; None: unlimited

    class Parameters(NamedTuple):
        rate: Array  # rates of x, y [m/s], yaw [rad/s] and speed
        longest: float
        onset: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        require_pose(channels, "PoseDrift", INSTEAD)
        rate = move(self.rate_mps, self.direction_deg, self.yaw_rate_dps, rng)
        longest = math.inf if self.longest_s is None else self.longest_s
        return self.Parameters(rate, longest, onset)

    @staticmethod
    def rule(parameters: Parameters, values: Array, time: float) -> None:
        rate, longest, onset = parameters
        for i in range(len(values)):
            if time >= onset[i]:
                values[i] += rate[i] * min(time - onset[i], longest)
