"""The price of the sensors."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from evoros.base.checks import NOT_NEGATIVE, Rule, checked
from evoros.measure.protocol import BOUNDS, DIRECTION, MINIMIZE, Evaluated

PRICES = Rule(
    "a mapping from types of sensors to prices of at least 0",
    lambda v: hasattr(v, "values") and all(map(NOT_NEGATIVE.holds, v.values())),
)


@dataclass(frozen=True)
@checked
class Cost:
    """The sum of the prices of all sensors, by their type."""

    title: ClassVar[str] = "cost of the sensors"
    unit: ClassVar[str] = ""
    of_design: ClassVar[bool] = True
    prices: Annotated[Mapping[str, float], PRICES] = field(default_factory=dict)  # by the type
    other_price: Annotated[float, NOT_NEGATIVE] = 1.0  # of types without a price
    bounds: Annotated[Sequence[float], BOUNDS] = (0.0, 12.0)
    direction: Annotated[str, DIRECTION] = MINIMIZE

    def compute(self, evaluated: Evaluated) -> float:
        """Return the sum over all robots with a design of their own."""
        mounts = (mount for robot in evaluated.robots.values() for mount in robot.mounts)
        return math.fsum(float(self.prices.get(each.sensor, self.other_price)) for each in mounts)
