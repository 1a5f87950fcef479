"""Coverage by direction: how many sensors of a design look each way."""

import numpy as np
import pandas as pd

from evoros.base.arrays import Array

STEP_DEG = 5
HEADINGS_DEG = np.arange(-180.0, 180.0, STEP_DEG)
"""In the robot's frame: 0 is ahead, left is positive; -180 is also 180."""
AHEAD_DEG = 30.0
"""What is seen within it of straight ahead counts as ahead."""
QUANTILES = 36
DESIGN = ["run", "treatment", "seed", "design"]
"""The columns of a table of sensors that name a design."""


def profiles(sensors: pd.DataFrame) -> pd.DataFrame:
    """A row a design, a column a heading [deg]: how many sensors cover it with their openings.

    The mean over the ``STEP_DEG`` around the heading, exactly: a cone of 30 deg around 0 counts 1
    from -10 to 10, one half at -15 and 15, where it ends, and 0 beyond. Counts at single headings
    would make equal profiles of designs that differ by less than a step. ``sensors`` has the
    columns of ``designs.py``; the index of what is returned, sorted, has those of ``DESIGN``. A row
    without a place stands for a design without sensors.
    """
    frame = pd.DataFrame(_overlap(sensors, HEADINGS_DEG, STEP_DEG / 2) / STEP_DEG)
    frame.columns = pd.Index(HEADINGS_DEG)
    return frame.groupby([sensors[name].to_numpy() for name in DESIGN]).sum().rename_axis(DESIGN)


def ahead(sensors: pd.DataFrame, within_deg: float = AHEAD_DEG) -> "pd.Series[float]":
    """For each design the share of its sensors' openings that lies within ``within_deg`` of ahead.

    The parts of all openings that lie there, over all openings. NaN: it has no sensors.
    """
    placed = sensors.yaw_deg.notna().to_numpy()
    opening = np.where(placed, sensors.fov_deg.to_numpy(float), 0.0)
    seen = _overlap(sensors, np.zeros(1), within_deg)[:, 0]
    keys = [sensors[name].to_numpy() for name in DESIGN]
    frame = pd.DataFrame({"seen": seen, "opening": opening}).groupby(keys).sum()
    whole = frame.opening.where(frame.opening > 0)
    return (frame.seen / whole).rename_axis(DESIGN).rename("ahead")


def _overlap(sensors: pd.DataFrame, headings: Array, around: float) -> Array:
    """(sensors, headings) how much of each opening [deg] lies within ``around`` of each heading."""
    yaw, half = (
        sensors.yaw_deg.to_numpy(float)[:, None],
        sensors.fov_deg.to_numpy(float)[:, None] / 2,
    )
    found = np.zeros((len(sensors), len(headings)))
    for turn in (-360.0, 0.0, 360.0):
        low = np.maximum(yaw - half, turn + headings - around)
        high = np.minimum(yaw + half, turn + headings + around)
        found += np.nan_to_num(np.maximum(high - low, 0.0))  # without a place: nothing
    return found


def directions(profile: pd.DataFrame) -> Array:
    """(n, ``QUANTILES``) how far off ahead [deg] a design looks: quantiles over all that it covers.

    Both sides count alike, so that a design and its mirror image have the same. The Euclidean
    distance of two rows over the root of ``QUANTILES`` is how far the cones would have to be turned
    (Wasserstein's distance of order 2). Unlike profiles, which bend into a curve while all sensors
    are turned together, these follow a straight line. A design that sees nothing: 180 throughout.
    """
    values = profile.to_numpy(float)
    mirrored = np.roll(values[:, ::-1], 1, axis=1)  # -180 stays, 5 comes to -5
    zero = len(HEADINGS_DEG) // 2
    either = np.hstack([values + mirrored, 2 * values[:, :1]])[:, zero:]  # at 0, 5 ... 180 deg off
    edges = np.clip(np.arange(either.shape[1] + 1) - 0.5, 0, zero) * STEP_DEG
    seen = np.hstack([np.zeros((len(values), 1)), np.cumsum(either * np.diff(edges), axis=1)])
    levels = (np.arange(QUANTILES) + 0.5) / QUANTILES
    rows = [
        np.interp(levels * each[-1], each, edges) if each[-1] > 0 else np.full(QUANTILES, 180.0)
        for each in seen
    ]
    return np.array(rows).reshape(-1, QUANTILES)


def shares(profile: pd.DataFrame) -> Array:
    """(n, 73) each profile over its sum, so that designs with more sensors compare.

    The last column is 1 for a design that sees nothing. Half the sum of the absolute differences of
    two rows is a distance: 0 for the same directions, 1 for none in common.
    """
    values = profile.to_numpy(float)
    whole = values.sum(axis=1, keepdims=True)
    blind = whole == 0
    return np.hstack([values / np.where(blind, 1.0, whole), blind.astype(float)])
