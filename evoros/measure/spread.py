"""The spread of the sensors."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from evoros.base.checks import checked
from evoros.measure.coverage import A_NAME
from evoros.measure.protocol import BOUNDS, DIRECTION, MAXIMIZE, Evaluated, Measure


@dataclass(frozen=True)
@checked
class Spread(Measure):
    """The sensors' root mean square distance from their centroid, relative to the robot's size."""

    title = "spread of the sensors"
    of_design = True
    robot: Annotated[str, A_NAME] = ""  # robot with a separate design; empty: first robot
    bounds: Annotated[Sequence[float], BOUNDS] = (0.0, 1.0)
    direction: Annotated[str, DIRECTION] = MAXIMIZE

    def compute(self, evaluated: Evaluated) -> float:
        robot = evaluated.robot(self.robot)
        places = robot.sensor_poses[:, :2]
        if not len(places):
            return 0.0
        offsets = places - np.add.reduce(places) / len(places)
        length, width = (robot.outline.max(axis=0) - robot.outline.min(axis=0)).tolist()
        mean_square = float(np.add.reduce((offsets * offsets).ravel())) / len(places)
        return math.sqrt(mean_square) / (math.hypot(length, width) / 2)
