"""The fraction of bearings that several sensors see."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import POSITIVE, checked
from evoros.measure.coverage import A_NAME
from evoros.measure.protocol import BOUNDS, DIRECTION, MAXIMIZE, Evaluated, Measure
from evoros.robot.seen import COUNT, find_seen


@dataclass(frozen=True)
@checked
class Redundancy(Measure):
    """The fraction of all bearings that at least two sensors see (``robot/seen.py``)."""

    title = "share of bearings seen by two or more sensors"
    of_design = True
    distance_m: Annotated[float, POSITIVE] = 2.0  # distance from the middle of the robot
    robot: Annotated[str, A_NAME] = ""  # robot with a separate design; empty: first robot
    bounds: Annotated[Sequence[float], BOUNDS] = (0.0, 0.5)
    direction: Annotated[str, DIRECTION] = MAXIMIZE

    def compute(self, evaluated: Evaluated) -> float:
        seen = find_seen(evaluated.robot(self.robot), self.distance_m)
        return int((seen.sum(axis=0) >= 2).sum()) / COUNT
