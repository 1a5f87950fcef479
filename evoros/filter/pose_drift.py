"""A localization that drifts, as one that integrates motions does."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, NUMBER, POSITIVE, checked
from evoros.filter.pose_jump import INSTEAD, move
from evoros.filter.protocol import GROWS, Channels, require_pose


@dataclass(frozen=True)
@checked
class PoseDrift:
    """Moves and turns the pose more and more: steadily from the onset on.

    The yaw is not wrapped: it may pass -pi or pi.
    """

    name: ClassVar[str] = "PoseDrift"
    effect: ClassVar[str] = GROWS
    rate_mps: Annotated[float, NOT_NEGATIVE] = 0.02
    direction_deg: Annotated[float | None, NUMBER] = None  # in the world; None: drawn
    yaw_rate_dps: Annotated[float, NUMBER] = 0.0  # left positive [deg/s]
    longest_s: Annotated[float | None, POSITIVE] = None  # then it grows no more; None: it does

    class Parameters(NamedTuple):
        rate: Array  # of x, y [m/s], yaw [rad/s] and speed
        longest: float
        onset: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        """Draw the direction.

        Raises:
            InputError: the channels are not a pose.
        """
        require_pose(channels, "PoseDrift", INSTEAD)
        rate = move(self.rate_mps, self.direction_deg, self.yaw_rate_dps, rng)
        longest = math.inf if self.longest_s is None else self.longest_s
        return self.Parameters(rate, longest, onset)

    @staticmethod
    def rule(parameters: Parameters, values: Array, time: float) -> None:
        """Add the error that has grown since the onset."""
        rate, longest, onset = parameters
        for i in range(len(values)):
            if time >= onset[i]:
                values[i] += rate[i] * min(time - onset[i], longest)
