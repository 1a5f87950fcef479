"""The fitness as a measure."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import checked
from evoros.measure.protocol import BOUNDS, DIRECTION, MAXIMIZE, Evaluated, Measure


@dataclass(frozen=True)
@checked
class FitnessMeasure(Measure):
    """The fitness of the design, by default the mean score of its trials."""

    title = "fitness"
    bounds: Annotated[Sequence[float], BOUNDS] = (0.0, 24.0)
    direction: Annotated[str, DIRECTION] = MAXIMIZE

    def compute(self, evaluated: Evaluated) -> float:
        return evaluated.fitness
