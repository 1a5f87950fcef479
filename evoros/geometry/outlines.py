"""Footprints of obstacles as arrays, for compiled rules."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evoros.base.arrays import Array
from evoros.geometry.footprint import Footprint

# One footprint: a row of FOOTPRINT_SIZE values; its corners are elsewhere.
CENTRE_X, CENTRE_Y, CIRCLE, ROUND, FIRST, BEHIND = range(6)
"""Centre and radius [m] of a circle around it, how far it reaches beyond its polygon [m], its
first corner, and the one behind its last."""
FOOTPRINT_SIZE = 6


@dataclass(frozen=True, eq=False)
class Outlines:
    """Footprints of obstacles, in arrays."""

    rows: Array  # (n, FOOTPRINT_SIZE)
    corners: Array  # (m, 2) [m], of all

    @classmethod
    def of(cls, areas: Sequence[Footprint]) -> "Outlines":
        """``areas`` in their order."""
        rows, first = np.empty((len(areas), FOOTPRINT_SIZE)), 0
        for row, area in zip(rows, areas, strict=True):
            x, y, circle = _disc(area)
            row[:] = x, y, circle, area.radius, first, first + len(area.vertices)
            first += len(area.vertices)
        corners = [area.vertices for area in areas]
        return cls(rows, np.concatenate(corners) if corners else np.zeros((0, 2)))


def _disc(area: Footprint) -> tuple[float, float, float]:
    """Centre and radius of a circle around a footprint."""
    x, y = ((area.vertices.min(axis=0) + area.vertices.max(axis=0)) / 2).tolist()
    reach = np.sqrt(((area.vertices - (x, y)) ** 2).sum(axis=1)).max()
    return x, y, float(reach) + area.radius
