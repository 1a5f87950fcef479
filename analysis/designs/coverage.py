"""Coverage by direction: how many sensors of a design look each way."""

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.sensor.protocol import RAY_DEG

STEP_DEG = 5
HEADINGS_DEG = np.arange(-180.0, 180.0, STEP_DEG)
"""In the robot's frame: 0 is ahead, left is positive; -180 is also 180."""
AHEAD_DEG = 30.0
"""Directions within it of straight ahead count as ahead."""
QUANTILES = 36
DESIGN = ["run", "treatment", "seed", "design"]
"""The columns of a table of sensors that identify a design."""


def compute_profiles(sensors: pd.DataFrame) -> pd.DataFrame:
    """Count the sensors that cover each heading: a row a design, a column a heading [deg].

    The count is the exact mean over the ``STEP_DEG`` around the heading, because counts at single
    headings would make designs equal that differ by less. The index, sorted, is ``DESIGN``.
    """
    frame = pd.DataFrame(_overlap(sensors, HEADINGS_DEG, STEP_DEG / 2) / STEP_DEG)
    frame.columns = pd.Index(HEADINGS_DEG)
    return frame.groupby([sensors[name].to_numpy() for name in DESIGN]).sum().rename_axis(DESIGN)


def share_ahead(sensors: pd.DataFrame, within_deg: float = AHEAD_DEG) -> "pd.Series[float]":
    """Return the share of each design's openings near ahead; NaN: no sensors."""
    placed = sensors.yaw_deg.notna().to_numpy()
    opening = np.where(placed, _openings(sensors), 0.0)
    seen = _overlap(sensors, np.zeros(1), within_deg)[:, 0]
    keys = [sensors[name].to_numpy() for name in DESIGN]
    frame = pd.DataFrame({"seen": seen, "opening": opening}).groupby(keys).sum()
    total = frame.opening.where(frame.opening > 0)
    return (frame.seen / total).rename_axis(DESIGN).rename("ahead")


def _overlap(sensors: pd.DataFrame, headings: Array, around: float) -> Array:
    """Return (sensors, headings) the part of each opening [deg] within ``around`` of a heading."""
    yaw, half = sensors.yaw_deg.to_numpy(float)[:, None], _openings(sensors)[:, None] / 2
    overlap = np.zeros((len(sensors), len(headings)))
    for turn in (-360.0, 0.0, 360.0):
        low = np.maximum(yaw - half, turn + headings - around)
        high = np.minimum(yaw + half, turn + headings + around)
        overlap += np.nan_to_num(np.maximum(high - low, 0.0))  # NaN: no sensor
    return overlap


def _openings(sensors: pd.DataFrame) -> Array:
    """Return the opening of each sensor [deg], at least what a single ray counts for."""
    openings: Array = np.maximum(sensors.fov_deg.to_numpy(float), RAY_DEG)  # NaN: no sensor
    return openings


def compute_directions(profiles: pd.DataFrame) -> Array:
    """Return (n, ``QUANTILES``) quantiles of the angle off ahead [deg] over all that is covered.

    Both sides count alike, and blind designs have 180. The Euclidean distance of two rows over the
    root of ``QUANTILES`` is the Wasserstein distance of order 2. If all sensors are turned
    together, these points move along a line, whereas profiles move along a curve.
    """
    values = profiles.to_numpy(float)
    mirrored = np.roll(values[:, ::-1], 1, axis=1)  # -180 stays, 5 moves to -5
    zero = len(HEADINGS_DEG) // 2
    # At 0, 5 ... 180 deg off ahead.
    both_sides = np.hstack([values + mirrored, 2 * values[:, :1]])[:, zero:]
    edges = np.clip(np.arange(both_sides.shape[1] + 1) - 0.5, 0, zero) * STEP_DEG
    seen = np.hstack([np.zeros((len(values), 1)), np.cumsum(both_sides * np.diff(edges), axis=1)])
    levels = (np.arange(QUANTILES) + 0.5) / QUANTILES
    rows = [
        np.interp(levels * row[-1], row, edges) if row[-1] > 0 else np.full(QUANTILES, 180.0)
        for row in seen
    ]
    return np.array(rows).reshape(-1, QUANTILES)


def normalize_profiles(profiles: pd.DataFrame) -> Array:
    """Return (n, 73) each profile over its sum; the last column is 1 for a design that is blind."""
    values = profiles.to_numpy(float)
    total = values.sum(axis=1, keepdims=True)
    blind = total == 0
    return np.hstack([values / np.where(blind, 1.0, total), blind.astype(float)])
