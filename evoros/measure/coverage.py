"""The fraction of bearings that the sensors see, all around or in a sector."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import FLAG, POSITIVE, Rule, checked, is_number, number_between
from evoros.measure.protocol import BOUNDS, DIRECTION, MAXIMIZE, Evaluated, Measure
from evoros.robot.seen import choose_sector, find_seen

BEARING = number_between(-180.0, 180.0)
SECTOR = Rule("an angle from 1 to 360", lambda v: is_number(v) and 1 <= v <= 360)
A_NAME = Rule("a string", lambda v: isinstance(v, str))


@dataclass(frozen=True)
@checked
class Coverage(Measure):
    """The fraction of a sector that at least one sensor sees at a distance (``robot/seen.py``)."""

    title: Annotated[str, A_NAME] = "share of bearings seen"
    of_design = True
    bearing_deg: Annotated[float, BEARING] = 0.0  # middle of the sector, positive to the left
    width_deg: Annotated[float, SECTOR] = 360.0
    both_sides: Annotated[bool, FLAG] = False  # True: adds the mirror image of the sector
    distance_m: Annotated[float, POSITIVE] = 2.0  # distance from the middle of the robot
    robot: Annotated[str, A_NAME] = ""  # robot with a separate design; empty: first robot
    bounds: Annotated[Sequence[float], BOUNDS] = (0.0, 1.0)
    direction: Annotated[str, DIRECTION] = MAXIMIZE

    def compute(self, evaluated: Evaluated) -> float:
        seen = find_seen(evaluated.robot(self.robot), self.distance_m)
        sector = choose_sector(self.bearing_deg, self.width_deg, self.both_sides)
        return int((seen.sum(axis=0)[sector] > 0).sum()) / int(sector.sum())
