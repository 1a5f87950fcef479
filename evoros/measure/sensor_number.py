"""The number of sensors."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import checked
from evoros.measure.protocol import BOUNDS, DIRECTION, MINIMIZE, Evaluated, Measure


@dataclass(frozen=True)
@checked
class SensorNumber(Measure):
    """The number of sensors in all designs, including twins and fixed sensors."""

    title = "number of sensors"
    of_design = True
    bounds: Annotated[Sequence[float], BOUNDS] = (0.0, 12.0)
    direction: Annotated[str, DIRECTION] = MINIMIZE

    def compute(self, evaluated: Evaluated) -> float:
        return float(sum(len(robot.mounts) for robot in evaluated.robots.values()))
