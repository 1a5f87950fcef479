"""The number of sensors."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from evoros.base.checks import checked
from evoros.measure.protocol import BOUNDS, DIRECTION, MINIMIZE, Evaluated


@dataclass(frozen=True)
@checked
class SensorNumber:
    """The number of sensors of all designs, with twins and fixed ones."""

    title: ClassVar[str] = "number of sensors"
    unit: ClassVar[str] = ""
    of_design: ClassVar[bool] = True
    bounds: Annotated[Sequence[float], BOUNDS] = (0.0, 12.0)
    direction: Annotated[str, DIRECTION] = MINIMIZE

    def compute(self, evaluated: Evaluated) -> float:
        """Count them on all robots with a design of their own."""
        return float(sum(len(robot.mounts) for robot in evaluated.robots.values()))
