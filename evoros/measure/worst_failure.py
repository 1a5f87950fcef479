"""The score if a design's worst failures coincided in all worlds."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import checked
from evoros.base.combining import mean_lowest
from evoros.measure.protocol import BOUNDS, DIRECTION, MAXIMIZE, Evaluated, Measure
from evoros.mission.mission import Outcomes

SHARE = 0.25


@dataclass(frozen=True)
@checked
class WorstFailure(Measure):
    """The mean score of the lowest quarter of trials if the worst draws of all worlds coincided.

    Trial k is composed of the kth-worst mission in each world. With more trials, this decreases
    much less than the minimum; with one trial it equals the fitness.
    """

    title = "score under the worst failures, mean of the lowest 25 %"
    bounds: Annotated[Sequence[float], BOUNDS] = (0.0, 24.0)
    direction: Annotated[str, DIRECTION] = MAXIMIZE

    def compute(self, evaluated: Evaluated) -> float:
        def score(outcomes: Outcomes) -> float:
            return evaluated.score([outcomes])

        worlds = zip(*evaluated.trials, strict=True)
        ordered = zip(*(sorted(in_world, key=score) for in_world in worlds), strict=True)
        return mean_lowest([evaluated.score(trial) for trial in ordered], SHARE)
