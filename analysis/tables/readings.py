"""The ranges in a trajectory, by sensor."""

import re
from collections.abc import Sequence

import numpy as np
import pandas as pd

from evoros.base.arrays import Array

_RANGE = re.compile(r"range_(\d+)(?:_\d+)?_m")


def group_ranges(trajectory: pd.DataFrame) -> list[Array]:
    """Return the ranges (rows, channels) [m] of each range sensor, in the order of the sensors."""
    columns: dict[int, list[str]] = {}
    for name in map(str, trajectory.columns):
        match = _RANGE.fullmatch(name)
        if match:
            columns.setdefault(int(match[1]), []).append(name)
    return [trajectory[names].to_numpy(float) for _, names in sorted(columns.items())]


def find_nearest(ranges: Array) -> Array:
    """Return the nearest of the ranges (rows, channels) in each row; NaN if all are silent."""
    return np.asarray(np.fmin.reduce(ranges, axis=1))


def merge_sectors(ranges: Array, bearings_deg: Sequence[float], most: int) -> list[Array]:
    """Return the nearest ranges (rows,) in sectors of equal width, from the right to the left.

    Each sector has a range at least, so that there are at most as many as ranges, or ``most``.
    """
    ordered = np.argsort(bearings_deg, kind="stable")
    sectors = np.array_split(ordered, min(most, len(ordered)))
    return [find_nearest(ranges[:, sector]) for sector in sectors]
