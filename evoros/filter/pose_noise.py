"""White Gaussian localization noise."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, checked
from evoros.filter.protocol import Channels, Filter, require_pose


@dataclass(frozen=True)
@checked
class PoseNoise(Filter):
    """Adds independent normal deviates to x, y, yaw (not wrapped) and speed of each sample."""

    name = "PoseNoise"
    sigma_position_m: Annotated[float, NOT_NEGATIVE] = 0.02  # standard deviation of x and of y
    sigma_yaw_deg: Annotated[float, NOT_NEGATIVE] = 1.0
    sigma_speed_mps: Annotated[float, NOT_NEGATIVE] = 0.0

    class Parameters(NamedTuple):
        sigma: Array
        onset: Array

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        instead = "add the filter to the controller's localization, or use GaussianNoise"
        require_pose(channels, "PoseNoise", instead)
        position, yaw = self.sigma_position_m, math.radians(self.sigma_yaw_deg)
        return self.Parameters(np.array([position, position, yaw, self.sigma_speed_mps]), onset)

    @staticmethod
    def rule(parameters: Parameters, rng: Generator, values: Array, time: float) -> None:
        """Add noise; random numbers are drawn for all values, whether active or not."""
        for i in range(len(values)):
            noise = parameters.sigma[i] * rng.standard_normal()
            if time >= parameters.onset[i]:
                values[i] += noise
