"""The mass of the sensors."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import checked
from evoros.measure.protocol import BOUNDS, DIRECTION, MINIMIZE, Evaluated, Measure


@dataclass(frozen=True)
@checked
class Mass(Measure):
    """The total mass [kg] of all sensors."""

    title = "mass of the sensors"
    unit = "kg"
    of_design = True
    bounds: Annotated[Sequence[float], BOUNDS] = (0.0, 1.0)
    direction: Annotated[str, DIRECTION] = MINIMIZE

    def compute(self, evaluated: Evaluated) -> float:
        robots = evaluated.robots.values()
        return math.fsum(sensor.mass_kg for robot in robots for sensor in robot.mounted_sensors())
