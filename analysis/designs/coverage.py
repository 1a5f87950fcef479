"""Number of a design's sensors that cover each heading, and distances between its sensors."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.failure.spatial import SpatialFailure
from evoros.sensor.protocol import RAY_DEG
from evoros.storage.figure_context import Ring

STEP_DEG = 5
HEADINGS_DEG = np.arange(-180.0, 180.0, STEP_DEG)
"""Headings in the robot's frame: 0 is ahead, left is positive, -180 equals 180."""
AHEAD_DEG = 30.0
"""Headings within this angle of straight ahead count as ahead."""
QUANTILES = 36
DESIGN = ["run", "treatment", "seed", "design"]
"""The columns of a sensor table that identify a design."""
NEAR_M, NEAR_DEG = 0.05, 15.0
"""Sensors that differ by at most this distance and angle (half a beam) are redundant."""
_PLACE = ["x_m", "y_m", "z_m", "yaw_deg", "pitch_deg", "pair"]


def compute_profiles(sensors: pd.DataFrame) -> pd.DataFrame:
    """Count the sensors that cover each heading: one row per design, one column per heading [deg].

    Each count is the exact mean over the ``STEP_DEG`` around the heading; counts at single headings
    would not distinguish designs that differ by less. The index, sorted, is ``DESIGN``.
    """
    frame = pd.DataFrame(_overlap(sensors, HEADINGS_DEG, STEP_DEG / 2) / STEP_DEG)
    frame.columns = pd.Index(HEADINGS_DEG)
    return frame.groupby([sensors[name].to_numpy() for name in DESIGN]).sum().rename_axis(DESIGN)


def share_ahead(sensors: pd.DataFrame, within_deg: float = AHEAD_DEG) -> "pd.Series[float]":
    """Return the share of each design's total field of view near ahead; NaN without sensors."""
    placed = sensors.yaw_deg.notna().to_numpy()
    opening = np.where(placed, _openings(sensors), 0.0)
    seen = _overlap(sensors, np.zeros(1), within_deg)[:, 0]
    keys = [sensors[name].to_numpy() for name in DESIGN]
    frame = pd.DataFrame({"seen": seen, "opening": opening}).groupby(keys).sum()
    total = frame.opening.where(frame.opening > 0)
    return (frame.seen / total).rename_axis(DESIGN).rename("ahead")


def _overlap(sensors: pd.DataFrame, headings: Array, around: float) -> Array:
    """Return the degrees that each sensor covers within ``around`` of a heading, (n, headings)."""
    yaw, half = sensors.yaw_deg.to_numpy(float)[:, None], _openings(sensors)[:, None] / 2
    overlap = np.zeros((len(sensors), len(headings)))
    for turn in (-360.0, 0.0, 360.0):
        low = np.maximum(yaw - half, turn + headings - around)
        high = np.minimum(yaw + half, turn + headings + around)
        overlap += np.nan_to_num(np.maximum(high - low, 0.0))  # NaN means no sensor
    return overlap


def _openings(sensors: pd.DataFrame) -> Array:
    """Return the field of view of each sensor [deg], at least ``RAY_DEG``, the width of a ray."""
    openings: Array = np.maximum(sensors.fov_deg.to_numpy(float), RAY_DEG)  # NaN means no sensor
    return openings


def compute_directions(profiles: pd.DataFrame) -> Array:
    """Return quantiles of the angle from ahead [deg] over all covered headings, (n, ``QUANTILES``).

    Left and right count alike; blind designs have 180. The Euclidean distance of two rows, divided
    by the root of ``QUANTILES``, is the Wasserstein distance of order 2. If all sensors rotate
    together, these points move along a line, whereas profiles move along a curve.
    """
    values = profiles.to_numpy(float)
    mirrored = np.roll(values[:, ::-1], 1, axis=1)  # -180 stays, 5 moves to -5
    zero = len(HEADINGS_DEG) // 2
    # The columns are 0, 5 ... 180 deg off ahead.
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
    """Divide each profile by its sum, (n, 73); the last column is 1 for a blind design."""
    values = profiles.to_numpy(float)
    total = values.sum(axis=1, keepdims=True)
    blind = total == 0
    return np.hstack([values / np.where(blind, 1.0, total), blind.astype(float)])


def paper_rings() -> tuple[Ring, ...]:
    """Return the damage rings of the paper's treatment ``spatial``."""
    failure = SpatialFailure()
    return tuple(map(Ring, failure.radii_m, failure.probabilities))


def measure_nearness(
    sensors: pd.DataFrame,
    rings: Sequence[Ring] = (),
    near_m: float = NEAR_M,
    near_deg: float = NEAR_DEG,
) -> pd.DataFrame:
    """Measure how close the sensors of each design are: one row per design, sorted by ``DESIGN``.

    ``redundant`` is true if two sensors that are not twins are at most ``near_m`` apart and differ
    by at most ``near_deg`` in yaw and pitch. ``closest_m`` is the minimum distance, infinite for
    fewer than two sensors. ``lost`` is the expected number of sensors that fail if damage with
    ``rings`` (default: from the paper) hits one of them.
    """
    rings = tuple(rings) or paper_rings()
    rows = {key: _measure(places, rings, near_m, near_deg) for key, places in _designs(sensors)}
    index = pd.MultiIndex.from_tuples(rows, names=DESIGN)
    columns = ["sensors", "redundant", "closest_m", "lost"]
    return pd.DataFrame(list(rows.values()), index, columns).sort_index()


def _designs(sensors: pd.DataFrame) -> Iterator[tuple[tuple[object, ...], Array]]:
    """Yield each design's key and its sensors' ``_PLACE`` (n, 6); n is 0 without sensors."""
    ordered = sensors.sort_values(DESIGN, kind="stable", ignore_index=True)
    keys = list(zip(*(ordered[name].tolist() for name in DESIGN), strict=True))
    values = ordered[_PLACE].to_numpy(float)
    begins = [i for i, key in enumerate(keys) if i == 0 or key != keys[i - 1]]
    for begin, end in pairwise([*begins, len(keys)]):
        rows = values[begin:end]
        yield keys[begin], rows[~np.isnan(rows[:, 0])]


def _measure(
    places: Array, rings: Sequence[Ring], near_m: float, near_deg: float
) -> tuple[object, ...]:
    n = len(places)
    distances = np.linalg.norm(places[:, None, :3] - places[None, :, :3], axis=2)
    turns = np.abs((places[:, None, 3:5] - places[None, :, 3:5] + 180.0) % 360.0 - 180.0)
    others = places[:, None, 5] != places[None, :, 5]
    same = others & (distances <= near_m + 1e-9) & (turns.max(axis=2) <= near_deg + 1e-9)
    closest = distances[~np.eye(n, dtype=bool)].min() if n > 1 else np.inf
    radii = np.array([ring.radius_m for ring in rings])
    probabilities = np.array([*(ring.probability for ring in rings), 0.0])
    chances = probabilities[np.searchsorted(radii, distances)]
    return n, bool(same.any()), float(closest), float(chances.sum() / n) if n else 0.0
