"""The price of the sensors."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import checked
from evoros.measure.coverage import A_NAME
from evoros.measure.protocol import BOUNDS, DIRECTION, MINIMIZE, Evaluated, Measure
from evoros.sensor.protocol import add_prices


@dataclass(frozen=True)
@checked
class Cost(Measure):
    """The total price of all sensors."""

    title = "price of the sensors"
    of_design = True
    bounds: Annotated[Sequence[float], BOUNDS] = (0.0, 50.0)
    direction: Annotated[str, DIRECTION] = MINIMIZE
    unit: Annotated[str, A_NAME] = ""

    def compute(self, evaluated: Evaluated) -> float:
        robots = evaluated.robots.values()
        return math.fsum(add_prices(robot.mounts, robot.sensors) for robot in robots)
