"""The clocks of a mission: since its start, and since the events that set in faults."""

import math
from collections.abc import Sequence

import numpy as np

from evoros.base.arrays import (
    FROM_X,
    FROM_Y,
    LEG_SIZE,
    STATE_SIZE,
    TO_X,
    TO_Y,
    Array,
    X,
    Y,
)
from evoros.base.compilable import compilable
from evoros.base.errors import InputError
from evoros.failure import trigger as kinds
from evoros.failure.trigger import Trigger

ROBOT, KIND, FIRST, SECOND, THIRD, USED, LAST_X, LAST_Y, BEGUN = range(9)
TRIGGER_SIZE = 9
"""The columns of ``Arrays.triggers``: the robot; a kind below and its numbers; what the robot has
used so far, and where it was; the time of the event [s], infinity before it."""

NEAR, ALONG, SPENT = range(3)
"""Kinds of events in the loop: near the place (x, y) within a distance; so many legs complete and
then so far along the next; an amount used, by so much for each second and each metre."""


def make_row(robot: int, trigger: Trigger, home: Sequence[float], route: Array) -> list[float]:
    """Return the row of a trigger for a robot that starts at ``home`` on a route, (legs, 2) [m].

    Raises:
        InputError: the route has no such waypoint.
    """
    kind, numbers = _describe(trigger, np.array([home[:2], *route]))
    return [robot, kind, *numbers, 0.0, *home[:2], math.inf]


def _describe(trigger: Trigger, points: Array) -> tuple[int, Sequence[float]]:
    """Return a kind of the loop and its three numbers."""
    if trigger.kind == kinds.PLACE:
        return NEAR, trigger.values
    if trigger.kind == kinds.USE:
        return SPENT, trigger.values
    if trigger.kind == kinds.WAYPOINT:
        legs, number = len(points) - 1, int(trigger.values[0])
        if number > legs:
            raise InputError(
                f"failure: the onset must be at a waypoint from 1 to {legs}, which the route has "
                f"(docs/parts/failure.md), not {number}; lower its number"
            )
        return ALONG, (number, -math.inf, 0.0)
    steps = np.diff(points, axis=0)
    lengths = np.sqrt((steps * steps).sum(axis=1)).tolist()
    total = math.fsum(lengths)
    rest = trigger.values[0] * (total if trigger.kind == kinds.COURSE else 1.0)
    if rest > total + 1e-9:
        raise InputError(
            f"failure: the onset must be within the route, which is {total:.4g} m long, not after "
            f"{rest:g} m; lower it"
        )
    for leg, length in enumerate(lengths):
        if rest <= length or leg == len(lengths) - 1:
            break
        rest -= length
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
