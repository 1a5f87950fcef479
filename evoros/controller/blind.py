"""No obstacle avoidance: the baseline that shows the worth of the sensors."""

from dataclasses import dataclass
from typing import ClassVar

from numpy.random import Generator

from evoros.robot.model import Robot


@dataclass(frozen=True)
class Blind:
    """A layer that never decides, so that the robot navigates whatever its sensors read."""

    mode: ClassVar[str] = "avoiding"

    def start(self, robot: Robot, period: float, rng: Generator) -> None:
        """Return no parameters and no memory."""

    @staticmethod
    def rule() -> bool:
        """Leave every decision to the layers behind."""
        return False
