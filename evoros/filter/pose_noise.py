"""White Gaussian noise of a localization."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import NO_MEMORY, POSE_SIZE, Array, RuleArrays
from evoros.base.checks import NOT_NEGATIVE, checked
from evoros.base.errors import InputError
from evoros.filter.protocol import Channels


@dataclass(frozen=True)
@checked
class PoseNoise:
    """Adds independent normal deviates to x and y, to the yaw and to the speed of each sample.

    The yaw is not wrapped: noise may carry it beyond -pi or pi.
    """

    name: ClassVar[str] = "PoseNoise"
    sigma_position_m: Annotated[float, NOT_NEGATIVE] = 0.02  # of x and of y
    sigma_yaw_deg: Annotated[float, NOT_NEGATIVE] = 1.0
    sigma_speed_mps: Annotated[float, NOT_NEGATIVE] = 0.0

    def start(self, channels: Channels, onset: Array, rng: Generator) -> RuleArrays:
        """Return the sigmas of x, y, yaw [rad] and speed, then ``onset`` (4,); no memory.

        Raises:
            InputError: the channels are not a pose.
        """
        # Four range sensors have as many values as a pose, but they have limits.
        if channels.size != POSE_SIZE or np.isfinite(channels.high).any():
            raise InputError(
                f"PoseNoise: must filter a pose (x, y, yaw, speed), not {channels.size} readings; "
                f"put it into the controller's localization, or use GaussianNoise here"
            )
        yaw = math.radians(self.sigma_yaw_deg)
        sigma = [self.sigma_position_m, self.sigma_position_m, yaw, self.sigma_speed_mps]
        return np.concatenate((sigma, onset)), NO_MEMORY

    @staticmethod
    def rule(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
        """Add the noise; one draw for every value, so that no value shifts another's noise."""
        n = len(values)
        for i in range(n):
            deviate = rng.standard_normal()
            if time >= parameters[n + i]:
                values[i] = values[i] + parameters[i] * deviate
