"""How well two measurements of the same things agree, and how well they could.

Measurements are arrays (n, k): n things, each measured k times. Bootstraps draw things, not
measurements, so that what belongs to one thing stays together.
"""

import math
from collections.abc import Callable, Iterator
from itertools import combinations, islice

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from evoros.base.arrays import Array

Chosen = NDArray[np.intp]
"""Rows, of resampled things."""

RESAMPLES = 2000
SPLITS = 200
"""Most ways of halving the measurements: of 4 there are 3, of 20 too many."""


def spearman(a: Array, b: Array) -> float:
    """Rank correlation of two arrays (n,), ties at their mean rank."""
    ranks = [pd.Series(values).rank().to_numpy() for values in (a, b)]
    if any(np.ptp(each) == 0 for each in ranks):
        return math.nan
    a, b = (each - each.mean() for each in ranks)
    return float((a * b).sum() / np.sqrt((a * a).sum() * (b * b).sum()))


def reliability(measured: Array) -> float:
    """Of the mean of all k measurements: its rank correlation with another such mean.

    The mean rank correlation r of halves (of h measurements) over the ways of halving, stepped up
    to all measurements: m r / (1 + (m - 1) r), m = k / h (Spearman 1910, Brown 1910).
    """
    count = measured.shape[1]
    halves = [
        spearman(measured[:, one].mean(axis=1), measured[:, other].mean(axis=1))
        for one, other in islice(_halvings(count), SPLITS)
    ]
    if not halves:
        return math.nan
    r, longer = float(np.mean(halves)), float(count / (count // 2))
    return longer * r / (1.0 + (longer - 1.0) * r)


def ceiling(a: Array, b: Array) -> float:
    """The rank correlation of the two means, if but for chance they ranked alike.

    sqrt(reliability of a * reliability of b): Spearman's (1904) correction for attenuation, solved
    for the correlation that is observed where the true one is 1. It presumes that the
    measurements of ``a`` and ``b`` have no luck in common.
    """
    return math.sqrt(max(reliability(a), 0.0) * max(reliability(b), 0.0))


def kappa(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> float:
    """Cohen's kappa: agreement beyond that of chance, 1 for perfect, 0 for none."""
    same = float((a == b).mean())
    p, q = float(a.mean()), float(b.mean())
    chance = p * q + (1.0 - p) * (1.0 - q)
    return (same - chance) / (1.0 - chance) if chance < 1.0 else math.nan


def interval(things: int, value: Callable[[Chosen], float]) -> tuple[float, float]:
    """95 % of the values of resampled things: the percentile bootstrap (Efron 1979)."""
    rng = np.random.default_rng(0)
    values = [value(rng.integers(things, size=things)) for _ in range(RESAMPLES)]
    low, high = np.nanpercentile(values, [2.5, 97.5])
    return float(low), float(high)


def _halvings(count: int) -> Iterator[tuple[list[int], list[int]]]:
    """Ways of taking two halves, each one once where they are few; of an odd count one is left."""
    half = count // 2
    if count <= 6:
        for one in combinations(range(count), half):
            rest = [i for i in range(count) if i not in one]
            yield from (
                (list(one), list(other)) for other in combinations(rest, half) if one < other
            )
        return
    rng = np.random.default_rng(0)
    while True:
        order = rng.permutation(count).tolist()
        yield order[:half], order[half : 2 * half]
