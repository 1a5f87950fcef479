"""The length of a driven track, and its distances to points and obstacles; compiled."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import types

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.compilation.rules import A1, A2, I8, compile_rule
from evoros.geometry import footprint
from evoros.geometry.polygon import polygon_distance, transform_polygon

CLEARANCES = types.void(A2, A2, A2, A2, A1)
SUMMARY = types.void(A2, A2, A2, A2, A2, I8, A1)
LAST_X, LAST_Y, LAST_TOUCH, ALONG = range(4)
WAY_SIZE = 4
"""Last position [m], 1 after a contact there, signed distance [m] along the heading in a contact.
"""
SHAKE_M = 0.01  # maximum jitter [m] of a robot that drives against a wall; MuJoCo reaches 5 mm


class TrackSummary(NamedTuple):
    """The length of a driven track, and its minimum distances to points and obstacles."""

    length: float  # driven distance [m]
    point_distances: tuple[float, ...]  # minimum distance [m] to each point
    clearance: float  # minimum distance [m] from the robot's outline to an obstacle


def summarize_track(
    track: Array, untouched: int, outline: Array, obstacles: footprint.Outlines, points: Array
) -> TrackSummary:
    """Summarize a ``track`` (t, 4) of x, y [m], yaw [rad] and contact (0 or 1).

    The clearance covers only the first ``untouched`` rows. ``outline`` (k, 2) [m] is convex and
    counter-clockwise, in the robot's frame; ``points`` are (n, 2) [m].
    """
    result = np.empty(2 + len(points))
    arrays = (track, outline, obstacles.rows, obstacles.corners, points)
    compile_rule(fill_summary, SUMMARY)(*map(np.ascontiguousarray, arrays), untouched, result)
    return TrackSummary(float(result[0]), tuple(result[2:].tolist()), float(result[1]))


def compute_clearances(
    outline: Array, poses: Array, obstacles: Sequence[footprint.Footprint]
) -> Array:
    """Return the distance (t,) [m] to the nearest obstacle at each pose of a robot; 0 on contact.

    The arguments are as in ``summarize_track``; the distance is infinite without obstacles.
    """
    outlines, result = footprint.Outlines.of(obstacles), np.empty(len(poses))
    arrays = (poses, outline, outlines.rows, outlines.corners)
    compile_rule(fill_clearances, CLEARANCES)(*map(np.ascontiguousarray, arrays), result)
    return result


def fill_summary(
    track: Array,
    outline: Array,
    rows: Array,
    corners: Array,
    points: Array,
    untouched: int,
    result: Array,
) -> None:
    """Write the summary of ``summarize_track`` into ``result``."""
    result[0], way = 0.0, np.zeros(WAY_SIZE)
    way[LAST_X], way[LAST_Y] = track[0, 0], track[0, 1]
    for i in range(1, len(track)):
        result[0] += add_driven(way, track[i, 0], track[i, 1], track[i, 2], track[i, 3] > 0.0)
    result[1] = _min_clearance(track[:untouched], outline, rows, corners)
    for j in range(len(points)):
        nearest = math.inf
        for i in range(len(track)):
            dx = track[i, 0] - points[j, 0]
            dy = track[i, 1] - points[j, 1]
            nearest = min(nearest, dx * dx + dy * dy)
        result[2 + j] = math.sqrt(nearest)


@compilable
def add_driven(way: Array, x: float, y: float, yaw: float, touching: bool) -> float:
    """Return the distance [m] driven; in contact, only along the heading and above ``SHAKE_M``."""
    dx, dy = x - way[LAST_X], y - way[LAST_Y]
    stays = touching and way[LAST_TOUCH] > 0.0
    way[LAST_X], way[LAST_Y], way[LAST_TOUCH] = x, y, 1.0 if touching else 0.0
    if not stays:
        way[ALONG] = 0.0
        return math.sqrt(dx * dx + dy * dy)
    sin, cos = elementary.sin_cos(yaw)
    way[ALONG] += dx * cos + dy * sin
    driven = abs(float(way[ALONG]))
    if driven <= SHAKE_M:
        return 0.0
    way[ALONG] = 0.0
    return driven


def fill_clearances(
    poses: Array, outline: Array, rows: Array, corners: Array, result: Array
) -> None:
    """Write the distances of ``compute_clearances``."""
    reach = _reach(outline)
    placed = outline.copy()
    for i in range(len(poses)):
        result[i] = _clearance(poses[i], outline, reach, placed, rows, corners)


@compilable
def _min_clearance(track: Array, outline: Array, rows: Array, corners: Array) -> float:
    """Return the minimum clearance [m], skipping poses too near the last one to lower it."""
    reach = _reach(outline)
    placed = outline.copy()
    smallest = math.inf
    excess = 0.0
    for i in range(len(track)):
        if i > 0:
            dx = track[i, 0] - track[i - 1, 0]
            dy = track[i, 1] - track[i - 1, 1]
            turn = abs(track[i, 2] - track[i - 1, 2])
            excess -= math.sqrt(dx * dx + dy * dy) + reach * turn
        if excess > 0.0:
            continue
        clearance = _clearance(track[i], outline, reach, placed, rows, corners)
        smallest = min(smallest, clearance)
        excess = clearance - smallest
    return smallest


@compilable
def _reach(outline: Array) -> float:
    squared = 0.0
    for i in range(len(outline)):
        squared = max(squared, outline[i, 0] * outline[i, 0] + outline[i, 1] * outline[i, 1])
    return math.sqrt(squared)


@compilable
def _clearance(
    pose: Array, outline: Array, reach: float, placed: Array, rows: Array, corners: Array
) -> float:
    """Return the distance [m] to the nearest obstacle at one pose; ``placed`` is overwritten."""
    x = pose[0]
    y = pose[1]
    sin, cos = elementary.sin_cos(pose[2])
    transform_polygon(outline, x, y, cos, sin, placed)
    smallest = math.inf
    for i in range(len(rows)):
        row = rows[i]
        dx = row[footprint.CENTRE_X] - x
        dy = row[footprint.CENTRE_Y] - y
        lower_bound = math.sqrt(dx * dx + dy * dy) - reach - row[footprint.CIRCLE]
        if lower_bound >= smallest:
            continue
        radius = row[footprint.RADIUS]
        polygon = corners[int(row[footprint.START]) : int(row[footprint.END])]
        distance = polygon_distance(placed, polygon, smallest + radius) - radius
        smallest = min(smallest, max(distance, 0.0))
    return smallest
