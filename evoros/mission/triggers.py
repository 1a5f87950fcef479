"""Updates the mission clocks, which count from the start and from fault triggers."""

import math
from collections.abc import Sequence

import numpy as np

from evoros.base import arrays
from evoros.base.arrays import FROM_X, FROM_Y, LEG_SIZE, STATE_SIZE, TO_X, TO_Y, Array, X, Y
from evoros.base.compilable import compilable
from evoros.failure import protocol as kinds
from evoros.failure.protocol import Trigger
from evoros.geometry.clearance import WAY_SIZE, add_driven

ROBOT, KIND, FIRST, SECOND, THIRD, USED, WAY = range(7)
BEGUN = WAY + WAY_SIZE
TRIGGER_SIZE = BEGUN + 1
"""Number of columns of ``Arrays.triggers``.

The columns are the robot's index, the kind of event, three numbers of the event, the amount used,
the memory of the driven path, and the time [s] of the event, infinity before it.
"""

NEAR, ALONG, SPENT = range(3)
"""Kinds of events: near a place, along the route, supply used up.

The numbers of an event are the x, y and radius of a place; the completed legs, the distance on the
next leg, and 0; or the amount of a supply and its use per second and per metre.
"""


def make_row(
    robot: int, trigger: Trigger, home: Sequence[float], route: Array, place: Sequence[float]
) -> list[float]:
    """Return the row of a robot's trigger; an event beyond the end of the route never occurs."""
    kind, numbers = _describe(trigger, measure_legs(home, route))
    return [robot, kind, *numbers, 0.0, *place[:2], 0.0, 0.0, math.inf]


def measure_legs(home: Sequence[float], route: Array) -> list[float]:
    """Return the length [m] of each leg of a route that starts at home."""
    steps: Array = np.diff(np.array([home[:2], *route]), axis=0)
    lengths: list[float] = np.sqrt((steps * steps).sum(axis=1)).tolist()
    return lengths


def _describe(trigger: Trigger, lengths: Sequence[float]) -> tuple[int, Sequence[float]]:
    """Return the kind of a trigger and its three numbers; ``lengths`` are leg lengths [m]."""
    if trigger.kind == kinds.PLACE:
        return NEAR, trigger.values
    if trigger.kind == kinds.USE:
        amount, per_s, per_m = trigger.values
        return SPENT, (amount + per_s * trigger.since_s, per_s, per_m)
    if trigger.kind == kinds.WAYPOINT:
        return ALONG, (trigger.values[0], -math.inf, 0.0)
    share = trigger.values[0]
    rest = share * math.fsum(lengths) if trigger.kind == kinds.COURSE else share
    leg = 0
    while leg < len(lengths) - 1 and rest > lengths[leg]:
        rest -= lengths[leg]
        leg += 1
    return ALONG, (leg, rest, 0.0)


@compilable
def update_clocks(
    clocks: Array, triggers: Array, visited: Array, states: Array, legs: Array, time: float
) -> None:
    """Update all clocks to ``time`` [s], and start the clocks of events that have occurred."""
    clocks[0] = time
    for n in range(len(triggers)):
        if triggers[n, BEGUN] == math.inf and _has_come(triggers[n], visited, states, legs, time):
            triggers[n, BEGUN] = time
        begun = triggers[n, BEGUN]
        clocks[n + 1] = -1.0 if begun == math.inf else time - begun


@compilable
def _has_come(row: Array, visited: Array, states: Array, legs: Array, time: float) -> bool:
    """Return True if a trigger's event has occurred; count the use of a supply."""
    i, kind = int(row[ROBOT]), row[KIND]
    at, leg = i * STATE_SIZE, i * LEG_SIZE
    x, y = float(states[at + X]), float(states[at + Y])
    if kind == NEAR:
        return bool(measure_distance(x, y, row[FIRST], row[SECOND]) <= row[THIRD])
    if kind == ALONG:
        if visited[i] != row[FIRST]:
            return bool(visited[i] > row[FIRST])
        goal_x, goal_y = float(legs[leg + TO_X]), float(legs[leg + TO_Y])
        length = measure_distance(legs[leg + FROM_X], legs[leg + FROM_Y], goal_x, goal_y)
        return bool(length - measure_distance(x, y, goal_x, goal_y) >= row[SECOND])
    yaw, touching = float(states[at + arrays.YAW]), float(states[at + arrays.CONTACT]) > 0.0
    row[USED] += row[THIRD] * add_driven(row[WAY:BEGUN], x, y, yaw, touching)
    return bool(row[USED] + row[SECOND] * time >= row[FIRST])


@compilable
def measure_distance(x: float, y: float, to_x: float, to_y: float) -> float:
    """Return the distance [m] between two points."""
    across, up = to_x - x, to_y - y
    return math.sqrt(across * across + up * up)
