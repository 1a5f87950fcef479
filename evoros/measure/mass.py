"""The mass of the sensors."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from evoros.base.checks import checked
from evoros.measure.protocol import BOUNDS, DIRECTION, MINIMIZE, Evaluated


@dataclass(frozen=True)
@checked
class Mass:
    """The mass [kg] of all sensors."""

    title: ClassVar[str] = "mass of the sensors"
    unit: ClassVar[str] = "kg"
    of_design: ClassVar[bool] = True
    bounds: Annotated[Sequence[float], BOUNDS] = (0.0, 1.0)
    direction: Annotated[str, DIRECTION] = MINIMIZE

    def compute(self, evaluated: Evaluated) -> float:
        """Return the sum over all robots with a design of their own."""
        robots = evaluated.robots.values()
        return math.fsum(sensor.mass_kg for robot in robots for sensor in robot.mounted_sensors())
