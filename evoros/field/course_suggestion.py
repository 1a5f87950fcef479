"""Suggests a course in a world that has none: straight legs on which a robot meets no obstacle."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.geometry.footprint import Footprint, distances
from evoros.world.course import Course

CELL_M = 0.1
MARGIN_M = 0.2  # free space beside the robot
OPEN_SIDE_M = 3.0  # half the side of the square that is suggested among no obstacles
SHORTEST_LEG_M, LONGEST_LEG_M = 1.5, 8.0
MAX_HALF_EXTENT_M = 20.0  # how far from the middle of a large world a course may reach
HOMES, CORNERS, TRIES = 12, 60, 4000
LARGE_ENOUGH_M = 24.0  # size of a loop, below which other homes are tried
DETOUR = 3.0  # how much larger a loop must be for each metre that its home is off the origin
CRUISE_MPS = 0.15  # average speed, with avoidance, for which the time limit allows


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """A grid of places where the centre of a robot meets no obstacle."""

    low: Array  # (2,) [m], corner of the grid
    free: NDArray[np.bool_]  # (rows along y, columns along x), cells of ``CELL_M``

    @classmethod
    def around(cls, footprints: Sequence[Footprint], radius_m: float) -> "FreeSpace":
        """Return the places that are farther than ``radius_m`` from all footprints."""
        corners = np.concatenate([footprint.vertices for footprint in footprints])
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        if np.abs(middle).max() < MAX_HALF_EXTENT_M / 2:
            middle = np.zeros(2)  # worlds are usually built around their origin
        low = np.maximum(corners.min(axis=0), middle - MAX_HALF_EXTENT_M)
        high = np.maximum(np.minimum(corners.max(axis=0), middle + MAX_HALF_EXTENT_M), low + 1.0)
        columns, rows = np.ceil((high - low) / CELL_M).astype(int)
        space = cls(low, np.ones((rows, columns), dtype=np.bool_))
        for footprint in footprints:
            space._block(footprint, radius_m)
        return space

    def _block(self, footprint: Footprint, radius_m: float) -> None:
        reach = footprint.radius + radius_m
        ends = footprint.vertices.min(axis=0) - reach, footprint.vertices.max(axis=0) + reach
        cells = (np.floor((end - self.low) / CELL_M).astype(int) for end in ends)
        (x0, y0), (x1, y1) = (np.clip(cell, 0, self.free.shape[::-1]) for cell in cells)
        column, row = np.meshgrid(np.arange(x0, x1 + 1), np.arange(y0, y1 + 1))
        window = self.free[y0 : y1 + 1, x0 : x1 + 1]
        column, row = (
            column[: len(window), : window.shape[1]],
            row[: len(window), : window.shape[1]],
        )
        centres = self.low + CELL_M * (np.column_stack((column.ravel(), row.ravel())) + 0.5)
        window &= (distances(footprint, centres) > radius_m).reshape(window.shape)

    def centres(self) -> Array:
        """Return the centres (n, 2) [m] of all free cells."""
        row, column = np.nonzero(self.free)
        centres: Array = self.low + CELL_M * (np.column_stack((column, row)) + 0.5)
        return centres

    def is_open(self, start: Array, end: Array) -> bool:
        """Return whether all cells on the straight line between two points are free."""
        count = 2 + int(math.dist(start, end) / (CELL_M / 2))
        points = start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)
        column, row = np.floor((points - self.low) / CELL_M).astype(int).T
        inside = (row >= 0) & (column >= 0)
        inside &= (row < self.free.shape[0]) & (column < self.free.shape[1])
        return bool(inside.all() and self.free[row, column].all())


def suggest_course(
    footprints: Sequence[Footprint], robot_radius_m: float, height_m: float = 0.02
) -> Course:
    """Suggest home and up to four waypoints with free straight lines between them.

    ``footprints`` are those of all obstacles that the robot can touch; it is set down with its
    frame ``height_m`` above the ground. The suggestion is deterministic. If the world has no room
    for two points that see each other, the course is a small square around the origin.
    """
    home, corners = np.zeros(2), OPEN_SIDE_M * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
    if footprints:
        space = FreeSpace.around(footprints, robot_radius_m + MARGIN_M)
        route = _find_route(space, np.random.default_rng(0))
        if route is not None:
            home, corners = route[0], route[1:]
    closed = np.vstack((home, corners, home))
    length = 2.0 * float(np.linalg.norm(np.diff(closed, axis=0), axis=1).sum())
    first = corners[0] - home
    return Course(
        home_x_m=round(float(home[0]), 2),
        home_y_m=round(float(home[1]), 2),
        home_z_m=height_m,
        home_yaw_rad=round(elementary.atan2(first[1], first[0]), 3),
        waypoints=[[round(float(x), 2), round(float(y), 2)] for x, y in corners],
        acceptance_m=round(min(1.0, max(0.3, robot_radius_m)), 2),
        time_limit_s=60.0 * math.ceil(length / CRUISE_MPS / 60.0),
        direction="random",
        end_on_collision=True,
    )


def _find_route(space: FreeSpace, rng: Generator) -> Array | None:
    """Find home and corners (n, 2) [m] that form a long loop of open legs."""
    centres = space.centres()
    if len(centres) < 2:
        return None
    by_distance = centres[np.argsort(np.linalg.norm(centres, axis=1), kind="stable")]
    homes = by_distance[[0, *np.sort(rng.integers(len(centres), size=HOMES))]]
    if space.is_open(np.zeros(2), np.zeros(2)):
        homes[0] = 0.0
    best: tuple[float, Array] | None = None
    for home in homes:
        near = centres[np.linalg.norm(centres - home, axis=1) < 2.0 * LONGEST_LEG_M]
        chosen = near[rng.integers(len(near), size=CORNERS)]
        found = _find_loop(space, np.vstack((home, chosen)), rng)
        if found is None:
            continue
        value = found[0] - DETOUR * float(np.linalg.norm(home))
        if best is None or value > best[0]:
            best = value, found[1]
        if best is not None and best[0] >= LARGE_ENOUGH_M:
            break
    return None if best is None else best[1]


def _find_loop(space: FreeSpace, points: Array, rng: Generator) -> tuple[float, Array] | None:
    """Find a wide loop over the first of ``points`` (n, 2) [m] and 4, else 3, 2 or 1 others.

    Returns its size and its corners. The size is its length [m] plus its area [m2], so that loops
    that go round something come before those that lead to and fro.
    """
    lengths = np.linalg.norm(points[:, None] - points[None], axis=2)
    legs = (lengths >= SHORTEST_LEG_M) & (lengths <= LONGEST_LEG_M)
    for i, j in zip(*np.nonzero(np.triu(legs)), strict=True):
        legs[i, j] = legs[j, i] = space.is_open(points[i], points[j])
    for count in (4, 3, 2, 1):
        picks = rng.integers(1, len(points), size=(TRIES, count))
        loops = _order_around(points, np.hstack((np.zeros((TRIES, 1), dtype=np.int64), picks)))
        starts, ends = loops, np.roll(loops, -1, axis=1)
        spread = _narrowest_gap(lengths, picks)
        valid = legs[starts, ends].all(axis=1) & (spread >= SHORTEST_LEG_M)
        if valid.any():
            size = _enclosed_area(points[loops]) + lengths[starts, ends].sum(axis=1)
            largest = int(np.where(valid, size, -1.0).argmax())
            return float(size[largest]), points[loops[largest]]
    return None


def _order_around(points: Array, loops: NDArray[np.int64]) -> NDArray[np.int64]:
    """Order each loop (n, k) by the bearing from its middle, from point 0 on: no legs cross."""
    places = points[loops]
    offsets = places - places.mean(axis=1, keepdims=True)
    order = np.argsort(
        elementary.atan2_all(offsets[:, :, 1], offsets[:, :, 0]), axis=1, kind="stable"
    )
    first = np.argmin(order, axis=1)
    turns = (first[:, None] + np.arange(loops.shape[1])) % loops.shape[1]
    return np.take_along_axis(loops, np.take_along_axis(order, turns, axis=1), axis=1)


def _enclosed_area(loops: Array) -> Array:
    """Return the area (n,) [m2] inside closed loops (n, k, 2), by the shoelace formula."""
    following = np.roll(loops, -1, axis=1)
    twice = loops[:, :, 0] * following[:, :, 1] - loops[:, :, 1] * following[:, :, 0]
    area: Array = np.abs(twice.sum(axis=1)) / 2.0
    return area


def _narrowest_gap(lengths: Array, picks: NDArray[np.int64]) -> Array:
    """Return the smallest distance [m] between any two of the picked points of each loop."""
    gaps = lengths[picks[:, :, None], picks[:, None, :]]
    diagonal = np.eye(picks.shape[1], dtype=np.bool_)
    smallest: Array = np.where(diagonal[None], np.inf, gaps).min(axis=(1, 2))
    return smallest
