"""The coverage after the worst failure of a few sensors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Annotated

import numpy as np

from evoros.base.checks import COUNT as A_COUNT
from evoros.base.checks import POSITIVE, checked
from evoros.measure.coverage import A_NAME
from evoros.measure.protocol import BOUNDS, DIRECTION, MAXIMIZE, Evaluated, Measure
from evoros.robot.seen import COUNT, find_seen


@dataclass(frozen=True)
@checked
class LeastCoverage(Measure):
    """The minimum fraction of all bearings that is seen after any ``failed`` sensors fail."""

    title = "share of bearings seen after the worst failure"
    of_design = True
    failed: Annotated[int, replace(A_COUNT, limit=3)] = 1
    distance_m: Annotated[float, POSITIVE] = 2.0  # distance from the middle of the robot
    robot: Annotated[str, A_NAME] = ""  # robot with a separate design; empty: first robot
    bounds: Annotated[Sequence[float], BOUNDS] = (0.0, 1.0)
    direction: Annotated[str, DIRECTION] = MAXIMIZE

    def compute(self, evaluated: Evaluated) -> float:
        seen = find_seen(evaluated.robot(self.robot), self.distance_m)
        if len(seen) <= self.failed:
            return 0.0
        counts, sizes = seen.sum(axis=0), seen.astype(np.int64)
        sets = combinations(range(len(seen)), self.failed)
        return min(int((counts > sizes[list(lost)].sum(axis=0)).sum()) for lost in sets) / COUNT
