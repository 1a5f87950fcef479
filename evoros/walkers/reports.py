"""What simulations report of walkers, after the states of the robots."""

import math

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.walkers import layout as at
from evoros.walkers.crowd import AWAY_M
from evoros.walkers.layout import REPORT_SIZE, Walking


@compilable
def report_walkers(now: Walking, reports: Array) -> None:
    """Write the report of each walker; the places of those that a mission has not are NaN."""
    for i in range(len(now.places)):
        away = now.places[i, 1] == AWAY_M
        reports[i * REPORT_SIZE + at.REPORT_X] = math.nan if away else now.places[i, 0]
        reports[i * REPORT_SIZE + at.REPORT_Y] = math.nan if away else now.places[i, 1]
        reports[i * REPORT_SIZE + at.REPORT_TOUCHED] = now.motions[i, at.TOUCHED]


@compilable
def note_touch(now: Walking, walker: int, robot: int) -> None:
    """Keep that a walker has touched a robot."""
    touched = now.motions[walker, at.TOUCHED]
    bit = 1.0
    for _ in range(robot):
        bit *= 2.0
    if math.floor(touched / bit) % 2.0 == 0.0:
        now.motions[walker, at.TOUCHED] = touched + bit


def has_touched(report: float, robot: int) -> bool:
    """Whether a walker with this report has touched a robot."""
    return bool(int(report) >> robot & 1)
