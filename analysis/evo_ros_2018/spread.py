"""How different designs are, between the champions of runs and within a population."""

import numpy as np
import pandas as pd
from scipy.spatial.distance import pdist, squareform

from evoros.base.arrays import Array

from ..designs.coverage import compute_profiles, normalize_profiles
from ..statistics.small_samples import LEVEL, NOTHING, RESAMPLES, SEED, Interval
from ..tables.candidates import place_candidates, read_generations
from ..tables.records import Record


def pairwise_distances(profiles: pd.DataFrame) -> Array:
    """Return (n, n) total variations of where designs look: 0 equal directions, 1 no overlap."""
    return np.asarray(squareform(pdist(normalize_profiles(profiles), "cityblock")) / 2)


def mean_distance(distances: Array) -> float:
    """Return the mean distance of two different designs; NaN if there are fewer than two."""
    n = len(distances)
    return float(distances.sum() / (n * (n - 1))) if n > 1 else np.nan


def resample_mean_distance(distances: Array, stream: int = 0) -> Array:
    """Return (``RESAMPLES``,) ``mean_distance`` of bootstrap samples of the designs.

    A design drawn twice makes no pair with itself, which would bias the mean downwards. For this
    reason ``scipy.stats.bootstrap`` is not used. Each ``stream`` draws other samples.
    """
    n, rng = len(distances), np.random.default_rng([SEED, stream])
    counts = rng.multinomial(n, np.full(n, 1 / n), size=RESAMPLES)
    pairs = n * n - (counts * counts).sum(axis=1)
    sums = ((counts @ distances) * counts).sum(axis=1)
    return np.asarray(sums / np.where(pairs == 0, np.nan, pairs))


def relative_difference(
    one: Array, one_random: float, other: Array, other_random: float
) -> Interval:
    """Return the spread of ``one`` less the spread of ``other``, each relative to random designs.

    The spreads are of distances as ``pairwise_distances`` returns; the interval is bootstrapped.
    """
    value = mean_distance(one) / one_random - mean_distance(other) / other_random
    if min(len(one), len(other)) < 2:
        return NOTHING
    resampled = (
        resample_mean_distance(one) / one_random - resample_mean_distance(other, 1) / other_random
    )
    low, high = np.nanquantile(resampled, [LEVEL / 2, 1 - LEVEL / 2])
    return Interval(float(value), float(low), float(high))


def read_diversity(record: Record) -> pd.DataFrame:
    """Read the mean distance of designs in the ``first`` and ``last`` population, with copies."""
    table = read_generations(record)
    first = table[table.generation == 0].drop_duplicates("id")
    pool = table[table.generation == table.generation.max()]
    survived = pool.groupby("id").survived.sum()  # an individual may be in several rows
    last = pool.drop_duplicates("id").assign(survived=lambda rows: rows.id.map(survived))
    copies = {"first": first.assign(survived=1), "last": last}
    return pd.DataFrame({name: [_diversity(rows, record)] for name, rows in copies.items()})


def _diversity(candidates: pd.DataFrame, record: Record) -> float:
    placed = place_candidates(candidates, record)
    profiles = compute_profiles(placed.assign(run=record.name, treatment="", seed=record.seed))
    profiles.index = profiles.index.get_level_values("design")
    complete = profiles.reindex(candidates.id, fill_value=0.0)  # designs without sensors, too
    counts = candidates.survived.to_numpy(int)
    return mean_distance(
        pairwise_distances(complete.loc[np.repeat(candidates.id.to_numpy(), counts)])
    )
