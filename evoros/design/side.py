"""The sides of a convex outline."""

import math
from dataclasses import dataclass

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.linear import product
from evoros.design.protocol import Point

SIDES = {"front": 0.0, "left": 90.0, "rear": 180.0, "right": -90.0, "all_around": 0.0}
"""The direction [deg] of each side, left positive."""
_HALF_SECTOR_DEG = 45.0
_ROUNDING_DEG = 1e-6


@dataclass(frozen=True)
class SideLine:
    """A line of corners along an outline, counter-clockwise; it may be a single corner."""

    corners: tuple[Point, ...]  # [m]
    normals_deg: tuple[float, ...]  # outwards, of each segment; of the corner if it is alone

    @property
    def length(self) -> float:
        """The length [m]."""
        return math.fsum(self._lengths())

    def _lengths(self) -> list[float]:
        return [math.dist(a, b) for a, b in zip(self.corners, self.corners[1:], strict=False)]

    def at(self, share: float) -> tuple[Point, float]:
        """Return the point at a share of the length, and the outward normal [deg] there."""
        rest = share * self.length
        for i, length in enumerate(self._lengths()):
            if rest <= length:
                (ax, ay), (bx, by) = self.corners[i], self.corners[i + 1]
                part = rest / length
                return (ax + part * (bx - ax), ay + part * (by - ay)), self.normals_deg[i]
            rest -= length
        return self.corners[-1], self.normals_deg[-1]


def trace_side(outline: Array, side: str) -> SideLine:
    """Return the edges of an outline (k, 2) [m] that face to a side, from right to left.

    These are the edges whose outward normal is at most 45 deg from the side's direction. If there
    is none, it is the corner that is farthest in that direction. The outline is convex and
    counter-clockwise.
    """
    direction = SIDES[side]
    reach = 180.0 if side == "all_around" else _HALF_SECTOR_DEG
    after = np.roll(outline, -1, axis=0)
    edges = []
    for a, b in zip(outline.tolist(), after.tolist(), strict=True):
        if a == b:
            continue
        normal = math.degrees(elementary.atan2(a[0] - b[0], b[1] - a[1]))
        turn = _wrap(normal - direction)
        if abs(turn) <= reach + _ROUNDING_DEG:
            edges.append((turn, a, b))
    if not edges:
        radians = math.radians(direction)
        farthest = product(outline, np.array([elementary.cos(radians), elementary.sin(radians)]))
        x, y = outline[int(np.argmax(farthest))].tolist()
        return SideLine(((x, y),), (direction,))
    edges.sort(key=lambda edge: edge[0])
    corners = [edges[0][1], *(b for _, _, b in edges)]
    normals = tuple(direction + turn for turn, _, _ in edges)  # ascending
    return SideLine(tuple((x, y) for x, y in corners), normals)


def _wrap(degrees: float) -> float:
    """Return an angle from above -180 to 180 deg."""
    return degrees - 360.0 * math.ceil((degrees - 180.0) / 360.0)
