"""The score in the world in which a design is worst."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Annotated, ClassVar

from evoros.base.checks import checked
from evoros.measure.protocol import BOUNDS, DIRECTION, MAXIMIZE, Evaluated


@dataclass(frozen=True)
@checked
class WorstWorld:
    """The minimum over the worlds of the mean score of the design's missions in one world."""

    title: ClassVar[str] = "score in the worst world"
    unit: ClassVar[str] = ""
    of_design: ClassVar[bool] = False
    bounds: Annotated[Sequence[float], BOUNDS] = (1.0, 8.0)
    direction: Annotated[str, DIRECTION] = MAXIMIZE

    def compute(self, evaluated: Evaluated) -> float:
        """Score each mission as if its world were the only one."""
        worlds = zip(*evaluated.trials, strict=True)
        return min(fmean(evaluated.score([one]) for one in outcomes) for outcomes in worlds)
