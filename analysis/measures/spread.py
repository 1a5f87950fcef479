"""How different designs are: between the champions of runs, and within a population."""

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.spatial.distance import pdist, squareform

from evoros.base.arrays import Array
from evoros.base.errors import InputError

from ..tables.designs import candidate_mounts, sensors
from .coverage import profiles, shares
from .statistics import LEVEL, RESAMPLES, SEED, Interval

if TYPE_CHECKING:
    from ..tables.records import Record


def apart(profile: pd.DataFrame) -> Array:
    """(n, n) how far each two designs look in different directions: 0 the same, 1 none in common.

    Half the sum of the absolute differences of the shares of their coverage (total variation).
    """
    return np.asarray(squareform(pdist(shares(profile), "cityblock")) / 2)


def mean_apart(distances: Array) -> float:
    """The mean distance of two different designs; NaN: there are fewer than two."""
    n = len(distances)
    return float(distances.sum() / (n * (n - 1))) if n > 1 else np.nan


def resampled(distances: Array, stream: int = 0) -> Array:
    """(``RESAMPLES``,) ``mean_apart`` of bootstrap samples of the designs.

    Pairs of one design with itself are no pairs: they would pull the mean down. Another ``stream``
    draws other samples.
    """
    n, rng = len(distances), np.random.default_rng([SEED, stream])
    drawn = rng.multinomial(n, np.full(n, 1 / n), size=RESAMPLES)
    pairs = n * n - (drawn * drawn).sum(axis=1)
    sums = ((drawn @ distances) * drawn).sum(axis=1)
    return np.asarray(sums / np.where(pairs == 0, np.nan, pairs))


def relative_difference(
    one: Array, one_random: float, other: Array, other_random: float
) -> Interval:
    """The spread of ``one`` less that of ``other``, each relative to that of its random designs.

    ``one`` and ``other`` are distances as ``apart`` gives; with the bootstrap's interval.
    """
    value = mean_apart(one) / one_random - mean_apart(other) / other_random
    if min(len(one), len(other)) < 2:
        return Interval(np.nan, np.nan, np.nan)
    drawn = resampled(one) / one_random - resampled(other, 1) / other_random
    low, high = np.nanquantile(drawn, [LEVEL / 2, 1 - LEVEL / 2])
    return Interval(float(value), float(low), float(high))


def diversity(record: "Record") -> pd.DataFrame:
    """``first`` and ``last``: how far apart the designs of the first and the last population are.

    Of the last generation's pool the copies that survived, of the first all that were made.
    """
    table = record.run.generations
    if table.empty:
        raise InputError(f"{record.path}: must have a generation, and has none; resume the run")
    first = table[table.generation == 0].drop_duplicates("id")
    pool = table[table.generation == table.generation.max()]
    survived = pool.groupby("id").survived.sum()  # one individual may stand in several rows
    last = pool.drop_duplicates("id").assign(survived=lambda rows: rows.id.map(survived))
    copies = {"first": first.assign(survived=1), "last": last}
    return pd.DataFrame({name: [_diversity(rows, record)] for name, rows in copies.items()})


def _diversity(candidates: pd.DataFrame, record: "Record") -> float:
    placed = sensors(candidate_mounts(candidates, record), record.setting)
    found = profiles(placed.assign(run=record.name, treatment="", seed=record.seed))
    found.index = found.index.get_level_values("design")
    whole = found.reindex(candidates.id, fill_value=0.0)  # those without sensors, too
    counts = candidates.survived.to_numpy(int)
    return mean_apart(apart(whole.loc[np.repeat(candidates.id.to_numpy(), counts)]))
