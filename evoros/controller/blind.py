"""No obstacle avoidance: the baseline that shows what the sensors are worth."""

from dataclasses import dataclass
from typing import ClassVar

from numpy.random import Generator

from evoros.base.arrays import NO_MEMORY, NO_PARAMETERS, Array, RuleArrays
from evoros.robot.model import Robot


@dataclass(frozen=True)
class Blind:
    """A layer that never decides, so that the robot navigates whatever its sensors read."""

    mode: ClassVar[str] = "avoiding"

    def start(self, robot: Robot, period: float, rng: Generator) -> RuleArrays:
        """Return no parameters and no memory."""
        return NO_PARAMETERS, NO_MEMORY

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
        """Leave every decision to the layers behind."""
        return False
