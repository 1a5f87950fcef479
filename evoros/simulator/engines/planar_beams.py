"""The beams of the planar simulator's sensors as arrays, and groups of beams.

Each beam of a lidar is one, so that all are computed together.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.compilation.elementary_arrays import atan2_all, cos_all, sin_all
from evoros.robot.model import Robot
from evoros.simulator.engines.rays import Beam

FULL_TURN = 2.0 * math.pi

# A beam, which is a channel of a sensor, is a row of the block BEAMS.
ORIGIN, MIN_RANGE, FREE_RANGE, FIRST_RAY, END_RAY, LEFT_EDGE, RIGHT_EDGE = 0, 3, 4, 5, 6, 7, 9
"""Origin (3,) [m]; minimum range [m]; reading without obstacles [m]; its first ray and the one
after its last; unit vectors (2,) outwards across the left and the right edge of its beam, or 0
without edges."""
BEAM_SIZE = 11

# A group of beams is a row of the block GROUPS.
FIRST_BEAM, END_BEAM, BEARING, SPACING, REACH = range(5)
"""Its first beam and the one after its last; if its beams start at one place, have one ray each and
are evenly spaced, the bearing of the first and the angle to the next [rad], left positive, or
zeros; the greatest range without obstacles [m]."""
GROUP_SIZE = 5
_UNEVEN_RAD = 1e-9
Indices = NDArray[np.int64]


def beam_rows(robot: Robot, frames: Array, beams: Sequence[Beam], rays: Array) -> Array:
    """Return the block BEAMS; ``frames`` are the mounts', ``rays`` all beams'."""
    rows = np.zeros((len(beams), BEAM_SIZE))
    if not len(beams):
        return rows
    ends = np.cumsum([len(beam.directions) for beam in beams])
    rows[:, ORIGIN : ORIGIN + 3] = [beam.origin for beam in beams]
    rows[:, MIN_RANGE] = [beam.range_min for beam in beams]
    rows[:, FIRST_RAY], rows[:, END_RAY] = np.concatenate(([0], ends[:-1])), ends
    first = rows[:, FIRST_RAY].astype(np.int64)
    farthest = np.array([beam.clear_range for beam in beams])
    rows[:, FREE_RANGE] = _free_ranges(rows[:, ORIGIN + 2], rays[:, 2], first, farthest)
    yaws = np.array(list(_facing(robot, frames, np.add.reduceat(rays, first))))
    rows[:, LEFT_EDGE : LEFT_EDGE + 4] = _edges(rays, first, yaws)
    return rows


def _facing(robot: Robot, frames: Array, sums: Array) -> Iterator[float]:
    """Yield the yaw [rad] of each beam: its sensor's, or with several channels its rays'."""
    for part, frame in zip(robot.beam_layout, frames, strict=True):
        if part.stop - part.start == 1:
            yield elementary.atan2(frame[1, 0], frame[0, 0])
        else:
            yield from (elementary.atan2(y, x) for x, y, _ in sums[part].tolist())


def _free_ranges(height: Array, slopes: Array, first: Indices, farthest: Array) -> Array:
    """Return the constant readings [m] without obstacles: the ground, or ``farthest``."""
    drop = -np.minimum.reduceat(slopes, first)
    seen = drop * farthest > height
    return np.where(seen, height / np.where(seen, drop, 1.0), farthest)


def _edges(rays: Array, first: Indices, yaws: Array) -> Array:
    """Return unit vectors (n, 4) outwards across each beam's edges, or zeros if it is no wedge."""
    x, y = rays[:, 0], rays[:, 1]
    angles = atan2_all(y, x) - np.repeat(yaws, np.diff([*first, len(rays)]))
    angles = atan2_all(sin_all(angles), cos_all(angles))
    high, low = np.maximum.reduceat(angles, first), np.minimum.reduceat(angles, first)
    wedges = np.minimum.reduceat(np.sqrt(x * x + y * y), first) >= 1e-6
    wedges &= np.maximum(np.abs(high), np.abs(low)) < math.pi / 2
    left, right = yaws + high, yaws + low
    edges = np.column_stack([-sin_all(left), cos_all(left), sin_all(right), -cos_all(right)])
    return edges * wedges[:, None]


def group_rows(robot: Robot, rows: Array, rays: Array) -> Array:
    """Return the block GROUPS: each even sensor, and whatever is between them."""
    groups: list[tuple[float, float, float, float, float]] = []
    for part in robot.beam_layout:
        bearing, spacing = _measure_spacing(rows[part], rays)
        if spacing == 0.0 and groups and groups[-1][SPACING] == 0.0:
            groups[-1] = (groups[-1][FIRST_BEAM], part.stop, 0.0, 0.0, 0.0)
        elif part.start < part.stop:
            reach = float(rows[part, FREE_RANGE].max())
            groups.append((part.start, part.stop, bearing, spacing, reach))
    return np.array(groups).reshape(-1, GROUP_SIZE)


def _measure_spacing(rows: Array, rays: Array) -> tuple[float, float]:
    """Return the bearing of the first of a sensor's beams, and their spacing [rad]; 0: uneven."""
    single = rows[:, END_RAY] - rows[:, FIRST_RAY] == 1.0
    if len(rows) < 2 or not single.all():
        return 0.0, 0.0
    x, y, _ = rays[rows[:, FIRST_RAY].astype(np.int64)].T
    bearings = np.unwrap(atan2_all(y, x))
    spaces = np.diff(bearings)
    spacing = float(spaces.mean())
    even = spacing > 0.0 and np.abs(spaces - spacing).max() < _UNEVEN_RAD
    return (float(bearings[0]), spacing) if even else (0.0, 0.0)


@compilable
def find_span(group: Array, x: float, y: float, radius: float) -> tuple[float, float]:
    """Return the span of an even group's beams that may meet a circle, counted from the first.

    (x, y) [m] is the centre of the circle from the beams' origin. The span may lie a turn of beams
    before or after the group's.
    """
    squared = x * x + y * y
    if squared <= radius * radius:
        return 0.0, group[END_BEAM] - group[FIRST_BEAM]
    half = elementary.asin(radius / math.sqrt(squared))
    middle = elementary.atan2(y, x) - group[BEARING]
    if middle < 0.0:
        middle += FULL_TURN
    # A beam more on each side, against rounding.
    return (middle - half) / group[SPACING] - 1.0, (middle + half) / group[SPACING] + 1.0
