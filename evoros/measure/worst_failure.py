"""The score under the worst failures that a design has met."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from evoros.base.checks import checked
from evoros.measure.protocol import BOUNDS, DIRECTION, MAXIMIZE, Evaluated
from evoros.mission.outcome import Outcomes


@dataclass(frozen=True)
@checked
class WorstFailure:
    """The score of a trial made up of the worst mission in each world, over all trials.

    Each trial draws failures of its own, so this is the score if in each world the worst failure
    struck that the design has met there. With one trial it is the fitness.
    """

    title: ClassVar[str] = "score under the worst failures"
    unit: ClassVar[str] = ""
    of_design: ClassVar[bool] = False
    bounds: Annotated[Sequence[float], BOUNDS] = (0.0, 24.0)
    direction: Annotated[str, DIRECTION] = MAXIMIZE

    def compute(self, evaluated: Evaluated) -> float:
        """Compare the missions of a world by their score as if it were the only world."""

        def score(outcomes: Outcomes) -> float:
            return evaluated.score([outcomes])

        worlds = zip(*evaluated.trials, strict=True)
        return evaluated.score([min(in_world, key=score) for in_world in worlds])
