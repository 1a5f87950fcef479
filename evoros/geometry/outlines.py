"""Footprints of obstacles as arrays, for compiled functions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evoros.base.arrays import Array
from evoros.geometry.footprint import Footprint, bounding_circle

# One footprint: a row of FOOTPRINT_SIZE values; the corners of all are in an array of their own.
CENTRE_X, CENTRE_Y, CIRCLE, RADIUS, START, END = range(6)
"""Centre and radius [m] of its bounding circle, its ``Footprint.radius`` [m], and the indices of
its first corner and of the one after its last."""
FOOTPRINT_SIZE = 6


@dataclass(frozen=True, eq=False)
class Outlines:
    """Footprints of obstacles, in arrays."""

    rows: Array  # (n, FOOTPRINT_SIZE)
    corners: Array  # (m, 2) [m], of all footprints

    @classmethod
    def of(cls, footprints: Sequence[Footprint]) -> "Outlines":
        """Put footprints into arrays, in their order."""
        rows, start = np.empty((len(footprints), FOOTPRINT_SIZE)), 0
        for row, footprint in zip(rows, footprints, strict=True):
            end = start + len(footprint.vertices)
            row[:] = *bounding_circle(footprint), footprint.radius, start, end
            start = end
        corners = [footprint.vertices for footprint in footprints]
        return cls(rows, np.concatenate(corners) if corners else np.zeros((0, 2)))
