"""No obstacle avoidance, as a baseline for the value of sensors."""

from dataclasses import dataclass

from numpy.random import Generator

from evoros.controller.protocol import Layer
from evoros.robot.model import Robot


@dataclass(frozen=True)
class Blind(Layer):
    """A layer that never decides, so that the robot ignores its sensors."""

    mode = "avoiding"

    def start(self, robot: Robot, period: float, rng: Generator) -> None:
        """Return no parameters and no memory."""

    @staticmethod
    def rule() -> bool:
        """Leave every decision to later layers."""
        return False
