"""The clocks of a mission: since its start, and since the events that set in faults."""

import math
from collections.abc import Sequence

import numpy as np

from evoros.base.arrays import FROM_X, FROM_Y, LEG_SIZE, STATE_SIZE, TO_X, TO_Y, Array, X, Y
from evoros.base.compilable import compilable
from evoros.failure import trigger as kinds
from evoros.failure.trigger import Trigger

ROBOT, KIND, FIRST, SECOND, THIRD, USED, LAST_X, LAST_Y, BEGUN = range(9)
TRIGGER_SIZE = 9
"""The columns of ``Arrays.triggers``: the robot; a kind below and its numbers; what the robot has
used so far, and where it was; the time of the event [s], infinity before it."""

NEAR, ALONG, SPENT = range(3)
"""Kinds of events in the loop: near the place (x, y) within a distance; so many legs complete and
then so far along the next; an amount used, by so much for each second and each metre."""


def make_row(
    robot: int, trigger: Trigger, home: Sequence[float], route: Array, place: Sequence[float]
) -> list[float]:
    """Return the row of a trigger for a robot at a place, on a route from home, (legs, 2) [m].

    An event that the route does not have never comes.
    """
    kind, numbers = _describe(trigger, measure_legs(home, route))
    return [robot, kind, *numbers, 0.0, *place[:2], math.inf]


def measure_legs(home: Sequence[float], route: Array) -> list[float]:
    """Return the lengths [m] of the legs of a route from home."""
    steps: Array = np.diff(np.array([home[:2], *route]), axis=0)
    lengths: list[float] = np.sqrt((steps * steps).sum(axis=1)).tolist()
    return lengths


def _describe(trigger: Trigger, lengths: Sequence[float]) -> tuple[int, Sequence[float]]:
    """Return a kind of the loop and its three numbers, on legs of these lengths [m]."""
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
    """Set all clocks to ``time`` [s] after the start; begin those whose event has come."""
    clocks[0] = time
    for n in range(len(triggers)):
        if triggers[n, BEGUN] == math.inf and _has_come(triggers[n], visited, states, legs, time):
            triggers[n, BEGUN] = time
        begun = triggers[n, BEGUN]
        clocks[n + 1] = -1.0 if begun == math.inf else time - begun


@compilable
def _has_come(row: Array, visited: Array, states: Array, legs: Array, time: float) -> bool:
    """Whether the event of a trigger has come; counts what its robot has used until ``time``."""
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
    row[USED] += row[THIRD] * measure_distance(x, y, row[LAST_X], row[LAST_Y])
    row[LAST_X], row[LAST_Y] = x, y
    return bool(row[USED] + row[SECOND] * time >= row[FIRST])


@compilable
def measure_distance(x: float, y: float, to_x: float, to_y: float) -> float:
    """Return the distance [m] between two places."""
    across, up = to_x - x, to_y - y
    return math.sqrt(across * across + up * up)
