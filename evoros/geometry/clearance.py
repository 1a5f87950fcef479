"""How far a robot drove, how near to places and to obstacles: compiled, for all simulators."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evoros.base.arrays import Array
from evoros.base.compilation import CLEARANCES, SURVEY, compilable, compile_rule
from evoros.geometry.footprint import Footprint
from evoros.geometry.outlines import BEHIND, CENTRE_X, CENTRE_Y, CIRCLE, FIRST, ROUND, Outlines
from evoros.geometry.polygon import gap, place


class Survey(NamedTuple):
    """What a track shows."""

    distance: float  # driven [m]
    places: tuple[float, ...]  # least distance [m] to each place
    clearance: float  # least distance [m] from the robot's outline to an obstacle; inf: none


def survey(track: Array, untouched: int, outline: Array, areas: Outlines, places: Array) -> Survey:
    """``track`` (t, 3) is x, y [m] and yaw [rad]; the first ``untouched`` rows count for clearance.

    ``outline`` (k, 2) is convex and counter-clockwise, in the robot's frame; ``places`` (n, 2).
    """
    found = np.empty(2 + len(places))
    arrays = (track, outline, areas.rows, areas.corners, places)
    compile_rule(_survey, SURVEY)(*map(np.ascontiguousarray, arrays), untouched, found)
    return Survey(float(found[0]), tuple(found[2:].tolist()), float(found[1]))


def clearances(outline: Array, poses: Array, obstacles: Sequence[Footprint]) -> Array:
    """Least distance (t,) [m] from a moving robot to any obstacle; 0 where it touches one.

    ``outline`` (k, 2) is convex and counter-clockwise, in the robot's frame [m]; ``poses`` (t, 3)
    are x [m], y [m] and yaw [rad] of that frame. Infinite where there are no obstacles.
    """
    areas, found = Outlines.of(obstacles), np.empty(len(poses))
    arrays = (poses, outline, areas.rows, areas.corners)
    compile_rule(_clearances, CLEARANCES)(*map(np.ascontiguousarray, arrays), found)
    return found


def _survey(
    track: Array,
    outline: Array,
    rows: Array,
    corners: Array,
    places: Array,
    untouched: int,
    found: Array,
) -> None:
    found[0] = 0.0
    for i in range(1, len(track)):
        dx = track[i, 0] - track[i - 1, 0]
        dy = track[i, 1] - track[i - 1, 1]
        found[0] += math.sqrt(dx * dx + dy * dy)
    found[1] = _least_clearance(track[:untouched], outline, rows, corners)
    for j in range(len(places)):
        least = math.inf
        for i in range(len(track)):
            dx = track[i, 0] - places[j, 0]
            dy = track[i, 1] - places[j, 1]
            least = min(least, dx * dx + dy * dy)
        found[2 + j] = math.sqrt(least)


def _clearances(poses: Array, outline: Array, rows: Array, corners: Array, found: Array) -> None:
    reach = _reach(outline)
    placed = outline.copy()
    for i in range(len(poses)):
        found[i] = _clearance(poses[i], outline, reach, placed, rows, corners)


@compilable
def _least_clearance(track: Array, outline: Array, rows: Array, corners: Array) -> float:
    """The least of all clearances, which are computed at few poses.

    No point of the robot moves farther than its origin does plus its reach times the turn: until
    that uses up what the clearance was above the least one, no less is to be found.
    """
    reach = _reach(outline)
    placed = outline.copy()
    least = math.inf
    spare = 0.0
    for i in range(len(track)):
        if i > 0:
            dx = track[i, 0] - track[i - 1, 0]
            dy = track[i, 1] - track[i - 1, 1]
            turn = abs(track[i, 2] - track[i - 1, 2])
            spare -= math.sqrt(dx * dx + dy * dy) + reach * turn
        if spare > 0.0:
            continue
        clearance = _clearance(track[i], outline, reach, placed, rows, corners)
        least = min(least, clearance)
        spare = clearance - least
    return least


@compilable
def _reach(outline: Array) -> float:
    """Of an outline from its origin [m]."""
    squared = 0.0
    for i in range(len(outline)):
        squared = max(squared, outline[i, 0] * outline[i, 0] + outline[i, 1] * outline[i, 1])
    return math.sqrt(squared)


@compilable
def _clearance(
    pose: Array, outline: Array, reach: float, placed: Array, rows: Array, corners: Array
) -> float:
    """Least distance [m] to an obstacle at one pose; ``placed`` is overwritten."""
    x = pose[0]
    y = pose[1]
    place(outline, x, y, math.cos(pose[2]), math.sin(pose[2]), placed)
    least = math.inf
    for i in range(len(rows)):
        row = rows[i]
        dx = row[CENTRE_X] - x
        dy = row[CENTRE_Y] - y
        apart = math.sqrt(dx * dx + dy * dy) - reach - row[CIRCLE]
        if apart >= least:
            continue
        other = corners[int(row[FIRST]) : int(row[BEHIND])]
        least = min(least, max(gap(placed, other, least + row[ROUND]) - row[ROUND], 0.0))
    return least
