"""The score in a design's worst world."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Annotated

from evoros.base.checks import checked
from evoros.measure.protocol import BOUNDS, DIRECTION, MAXIMIZE, Evaluated, Measure


@dataclass(frozen=True)
@checked
class WorstWorld(Measure):
    """The minimum over the worlds of the mean mission score."""

    title = "score in the worst world"
    bounds: Annotated[Sequence[float], BOUNDS] = (1.0, 8.0)
    direction: Annotated[str, DIRECTION] = MAXIMIZE

    def compute(self, evaluated: Evaluated) -> float:
        worlds = zip(*evaluated.trials, strict=True)
        return min(fmean(evaluated.score([one]) for one in outcomes) for outcomes in worlds)
