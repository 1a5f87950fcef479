"""Array layouts of walkers: their parameters, and their state in a mission."""

from typing import NamedTuple

from evoros.base.arrays import Array, Matrix

(
    RADIUS, PACE, FIRST, END, KIND, AVOIDS, STOP_GAP, PATIENCE, RELAXATION, REPULSION, RANGE,
    BORDER_REPULSION, BORDER_RANGE, DELAY, LOOPS,
) = range(15)  # fmt: skip
"""Columns of a walker.

Radius [m]; pace [m/s]; indices of the first corner and the end of the corners; kind; 1 if robots
repel it; gap [m] at which it stops for a robot, or 0, and maximum wait [s]; its ``SocialForce``;
for an actor, the pause [s] before each round, and 1 if there are several rounds.
"""
WALKER_SIZE = 15
ABSENT, WALKING, ACTING = range(3)  # not in this mission, driven by forces, following a script
VELOCITY_X, VELOCITY_Y, NEXT_X, NEXT_Y, GOAL, BACKWARDS, BLOCKED, CLOCK, WAITED, TOUCHED = range(10)
"""Columns of a walker's motion.

Current and next velocity [m/s]; index of the next corner; 1 on the way back; time without progress
[s]; time in its script [s]; time spent waiting for a robot [s]; and the sum of 2**i over the robots
i that it has touched.
"""
MOTION_SIZE = 10
CORNER_X, CORNER_Y, CORNER_S = range(3)  # position [m] and, in a script, time [s]
CORNER_SIZE = 3
REPORT_X, REPORT_Y, REPORT_TOUCHED = range(3)  # entries after the robots' states; NaN if absent
REPORT_SIZE = 3
REPORT_COLUMNS = ("x_m", "y_m", "touched_by")


class Walk(NamedTuple):
    """The parameters of the rule that moves the walkers."""

    walkers: Matrix  # (n, WALKER_SIZE)
    corners: Matrix  # (c, CORNER_SIZE)
    ends: Array  # (robots + 1,), start of each robot's outline, and the end
    outlines: Matrix  # (k, 2) [m], corners of all outlines in the robot frames
    grid: Array  # see evoros.geometry.grid
    starts: Array  # index of the first entry of each grid cell
    entries: Array  # indices of the footprints within reach of each grid cell
    footprints: Matrix  # see evoros.geometry.footprint
    borders: Matrix  # (c, 2) [m], corners of the footprints


class Walking(NamedTuple):
    """The memory of the rule that moves the walkers: positions and motions."""

    places: Matrix  # (n, 2) [m]
    motions: Matrix  # (n, MOTION_SIZE)
