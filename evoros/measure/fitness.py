"""The fitness itself."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from evoros.base.checks import checked
from evoros.measure.protocol import BOUNDS, DIRECTION, MAXIMIZE, Evaluated


@dataclass(frozen=True)
@checked
class FitnessMeasure:
    """The fitness of the design, the mean over its trials."""

    title: ClassVar[str] = "fitness"
    unit: ClassVar[str] = ""
    of_design: ClassVar[bool] = False
    bounds: Annotated[Sequence[float], BOUNDS] = (0.0, 24.0)
    direction: Annotated[str, DIRECTION] = MAXIMIZE

    def compute(self, evaluated: Evaluated) -> float:
        """Return it."""
        return evaluated.fitness
