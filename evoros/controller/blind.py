"""No obstacle avoidance: the baseline that shows what the sensors are worth."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.controller.protocol import LayerRule

if TYPE_CHECKING:
    from evoros.robot.model import Robot


def never(
    parameters: Array,
    memory: Array,
    state: Array,
    leg: Array,
    readings: Array,
    time: float,
    command: Array,
) -> bool:
    """Leave every decision to the layers behind."""
    return False


@dataclass(frozen=True)
class Blind:
    """A layer that never decides, so that the robot navigates whatever its sensors read."""

    @property
    def mode(self) -> str:
        """Never reached."""
        return "avoiding"

    @property
    def rule(self) -> LayerRule:
        """Never decides."""
        return never

    def start(self, robot: "Robot", period: float, rng: Generator) -> tuple[Array, Array]:
        """Neither parameters nor memory."""
        return np.zeros(0), np.zeros(0)
