"""Sensors of a design near each other: redundancy, and what one blow takes."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.failure.spatial import SpatialFailure
from evoros.storage.figure_context import Ring

from .coverage import DESIGN

NEAR_M, NEAR_DEG = 0.05, 15.0
"""Sensors nearer to each other than both, half a beam, are redundant."""


def paper_rings() -> tuple[Ring, ...]:
    """The damage of the paper's treatment ``spatial``."""
    of = SpatialFailure()
    return tuple(map(Ring, of.radii_m, of.probabilities))


def nearness(
    sensors: pd.DataFrame,
    rings: Sequence[Ring] = (),
    near_m: float = NEAR_M,
    near_deg: float = NEAR_DEG,
) -> pd.DataFrame:
    """A row a design (index ``DESIGN``, sorted), of a table with the columns of ``designs.py``.

    - ``sensors``: how many it has;
    - ``redundant``: whether two sensors, not twins, are at most ``near_m`` apart (straight) and
      their yaw and their pitch each differ by at most ``near_deg``;
    - ``closest_m``: the least distance of any two, twins included; infinite with fewer than two;
    - ``lost``: how many fail, in the mean, when damage with ``rings`` (default: the paper's) has
      its centre at one of them, chosen uniformly.
    """
    rings = tuple(rings) or paper_rings()
    rows = {key: _row(each, rings, near_m, near_deg) for key, each in _designs(sensors)}
    index = pd.MultiIndex.from_tuples(rows, names=DESIGN)
    columns = ["sensors", "redundant", "closest_m", "lost"]
    return pd.DataFrame(list(rows.values()), index, columns).sort_index()


PLACE = ["x_m", "y_m", "z_m", "yaw_deg", "pitch_deg", "pair"]


def _designs(sensors: pd.DataFrame) -> Iterator[tuple[tuple[object, ...], Array]]:
    """The numbers (n, 6) of each design's sensors; none where it has no place."""
    ordered = sensors.sort_values(DESIGN, kind="stable", ignore_index=True)
    keys = list(zip(*(ordered[name].tolist() for name in DESIGN), strict=True))
    values = ordered[PLACE].to_numpy(float)
    begins = [i for i, key in enumerate(keys) if i == 0 or key != keys[i - 1]]
    for begin, end in pairwise([*begins, len(keys)]):
        each = values[begin:end]
        yield keys[begin], each[~np.isnan(each[:, 0])]


def _row(each: Array, rings: Sequence[Ring], near_m: float, near_deg: float) -> tuple[object, ...]:
    n = len(each)
    apart = np.linalg.norm(each[:, None, :3] - each[None, :, :3], axis=2)
    turned = np.abs((each[:, None, 3:5] - each[None, :, 3:5] + 180.0) % 360.0 - 180.0).max(axis=2)
    others = each[:, None, 5] != each[None, :, 5]
    same = others & (apart <= near_m + 1e-9) & (turned <= near_deg + 1e-9)
    closest = apart[~np.eye(n, dtype=bool)].min() if n > 1 else np.inf
    radii = np.array([ring.radius_m for ring in rings])
    chance = np.array([*(ring.probability for ring in rings), 0.0])[np.searchsorted(radii, apart)]
    return n, bool(same.any()), float(closest), float(chance.sum() / n) if n else 0.0
