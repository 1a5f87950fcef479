"""The parameters of walkers, and where they are in a mission."""

from typing import NamedTuple

from evoros.base.arrays import Array, Matrix

(
    RADIUS, PACE, FIRST, END, KIND, AVOIDS, STOP_GAP, PATIENCE, RELAXATION, REPULSION, RANGE,
    BORDER_REPULSION, BORDER_RANGE, DELAY, LOOPS,
) = range(15)  # fmt: skip
"""A walker: radius [m]; pace [m/s]; its first corner and the one after its last; its kind; whether
robots repel it; the gap [m] to a robot at which it stops, or 0, and how long [s] at most; its
``SocialForce``; and of an actor, the time [s] before each round, and whether there are several."""
WALKER_SIZE = 15
ABSENT, WALKING, ACTING = range(3)
"""Kinds: not in this mission; one that walks by forces; one that follows the times of a script."""

VELOCITY_X, VELOCITY_Y, NEXT_X, NEXT_Y, GOAL, BACKWARDS, BLOCKED, CLOCK, WAITED, TOUCHED = range(10)
"""How a walker moves: its velocity now and next [m/s]; the corner to which it walks; whether it
goes round its route backwards; how long it has not come on [s]; the time [s] of its script; how
long it has waited for a robot [s]; and the sum of 2**i over the robots i that it has touched."""
MOTION_SIZE = 10

CORNER_X, CORNER_Y, CORNER_S = range(3)
"""A corner: its place [m] and, in a script, its time [s]."""
CORNER_SIZE = 3

REPORT_X, REPORT_Y, REPORT_TOUCHED = range(3)
"""What a simulation reports of each walker, after the states of the robots; NaN if it is absent."""
REPORT_SIZE = 3
REPORT_COLUMNS = ("x_m", "y_m", "touched_by")


class Walk(NamedTuple):
    """Walkers among obstacles and robots: the parameters of their rule."""

    walkers: Matrix  # (n, WALKER_SIZE)
    corners: Matrix  # (c, CORNER_SIZE)
    ends: Array  # (robots + 1,), where the outline of each robot begins
    outlines: Matrix  # (k, 2) [m], of the robots in their frames
    grid: Array  # as in evoros.geometry.grid
    starts: Array  # by cell of the grid, its first of the entries
    entries: Array  # rows of the footprints within reach of a walker
    footprints: Matrix  # as in evoros.geometry.outlines
    borders: Matrix  # (c, 2) [m], the corners of these


class Walking(NamedTuple):
    """Where walkers are: the memory of their rule."""

    places: Matrix  # (n, 2) [m]
    motions: Matrix  # (n, MOTION_SIZE)
