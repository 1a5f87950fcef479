"""Agreement between two measurements of the same items, and the maximum that chance allows.

Measurements are arrays (n, k) of n items, each measured k times. Bootstraps resample items and not
single measurements, so that the measurements of one item stay together.
"""

import math
from collections.abc import Callable, Iterator
from itertools import combinations, islice, permutations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from evoros.base.arrays import Array

Rows = NDArray[np.intp]
"""The rows of resampled items."""

RESAMPLES = 2000
SPLITS = 200
"""The maximum number of halvings that are averaged: 4 measurements have 3, 20 have too many."""


def spearman(a: Array, b: Array) -> float:
    """Spearman's rank correlation of two arrays (n,); ties have mean ranks, constants give NaN."""
    ranks = [pd.Series(values).rank().to_numpy() for values in (a, b)]
    if any(np.ptp(values) == 0 for values in ranks):
        return math.nan
    a, b = (values - values.mean() for values in ranks)
    return float((a * b).sum() / np.sqrt((a * a).sum() * (b * b).sum()))


def reliability(measured: Array) -> float:
    """Rank correlation of the mean of all k measurements with another such mean.

    It is the mean rank correlation r of two halves (of h measurements each) over the ways of
    halving, stepped up to all measurements by m r / (1 + (m - 1) r) with m = k / h (Spearman 1910,
    Brown 1910).
    """
    count = measured.shape[1]
    halves = [
        spearman(measured[:, half].mean(axis=1), measured[:, other].mean(axis=1))
        for half, other in islice(_halvings(count), SPLITS)
    ]
    if not halves:
        return math.nan
    r, m = float(np.mean(halves)), float(count / (count // 2))
    return m * r / (1.0 + (m - 1.0) * r)


def ceiling(a: Array, b: Array) -> float:
    """Rank correlation of the two means, if their rankings differ by chance only.

    It is sqrt(reliability of a * reliability of b), Spearman's (1904) correction for attenuation,
    solved for the observed correlation at a true correlation of 1. It assumes that the
    measurements of ``a`` and ``b`` are independent.
    """
    return math.sqrt(max(reliability(a), 0.0) * max(reliability(b), 0.0))


def unlimited(a: Array, b: Array) -> float:
    """Rank correlation that the means would have if each item were measured without end.

    Spearman's (1904) correction for attenuation, r_ab / sqrt(r_aa r_bb), where each r is the mean
    rank correlation of two measurements with different draws: column i of one array and column j
    of the other. So luck that ``a`` and ``b`` share, because their columns have the same draws,
    does not count as agreement.
    """
    return _between_draws(a, b) / math.sqrt(_between_draws(a, a) * _between_draws(b, b))


def _between_draws(a: Array, b: Array) -> float:
    return float(
        np.mean([spearman(a[:, i], b[:, j]) for i, j in permutations(range(a.shape[1]), 2)])
    )


def kappa(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> float:
    """Cohen's kappa: 1 for perfect agreement, 0 for agreement by chance."""
    same = float((a == b).mean())
    p, q = float(a.mean()), float(b.mean())
    chance = p * q + (1.0 - p) * (1.0 - q)
    return (same - chance) / (1.0 - chance) if chance < 1.0 else math.nan


def interval(items: int, value: Callable[[Rows], float]) -> tuple[float, float]:
    """The range of 95 % of the values of resampled items: the percentile bootstrap (Efron 1979)."""
    rng = np.random.default_rng(0)
    values = [value(rng.integers(items, size=items)) for _ in range(RESAMPLES)]
    low, high = np.nanpercentile(values, [2.5, 97.5])
    return float(low), float(high)


def _halvings(count: int) -> Iterator[tuple[list[int], list[int]]]:
    """Yield pairs of disjoint halves: all of them if they are few, else random ones without end.

    An odd count leaves one measurement out of each pair.
    """
    half = count // 2
    if count <= 6:
        for first in combinations(range(count), half):
            others = [i for i in range(count) if i not in first]
            yield from (
                (list(first), list(second))
                for second in combinations(others, half)
                if first < second
            )
        return
    rng = np.random.default_rng(0)
    while True:
        order = rng.permutation(count).tolist()
        yield order[:half], order[half : 2 * half]
