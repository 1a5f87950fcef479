"""Sensors of a design near each other: redundancy, and how many damage takes."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.failure.spatial import SpatialFailure
from evoros.storage.figure_context import Ring

from .coverage import DESIGN

NEAR_M, NEAR_DEG = 0.05, 15.0
"""Sensors that differ by at most these in place and direction (half a beam) are redundant."""
_PLACE = ["x_m", "y_m", "z_m", "yaw_deg", "pitch_deg", "pair"]


def paper_rings() -> tuple[Ring, ...]:
    """Return the rings of damage of the paper's treatment ``spatial``."""
    failure = SpatialFailure()
    return tuple(map(Ring, failure.radii_m, failure.probabilities))


def measure_nearness(
    sensors: pd.DataFrame,
    rings: Sequence[Ring] = (),
    near_m: float = NEAR_M,
    near_deg: float = NEAR_DEG,
) -> pd.DataFrame:
    """Measure how near the sensors of each design are: a row a design, sorted index ``DESIGN``.

    ``redundant``: two sensors, not twins, are at most ``near_m`` apart, and yaw and pitch differ by
    at most ``near_deg``; ``closest_m``: minimum distance, infinite below two sensors; ``lost``:
    expected number that fails if damage with ``rings`` (default: the paper's) hits one of them.
    """
    rings = tuple(rings) or paper_rings()
    rows = {key: _measure(places, rings, near_m, near_deg) for key, places in _designs(sensors)}
    index = pd.MultiIndex.from_tuples(rows, names=DESIGN)
    columns = ["sensors", "redundant", "closest_m", "lost"]
    return pd.DataFrame(list(rows.values()), index, columns).sort_index()


def _designs(sensors: pd.DataFrame) -> Iterator[tuple[tuple[object, ...], Array]]:
    """Yield key and ``_PLACE`` (n, 6) of the sensors of each design; n is 0 without sensors."""
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
