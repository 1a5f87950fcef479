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

from evoros.types import Array

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

    The mean rank correlation r of the two halves over the ways of halving, stepped up to the full
    length by the Spearman-Brown formula 2 r / (1 + r) (Spearman 1910, Brown 1910).
    """
    halves = [
        spearman(measured[:, one].mean(axis=1), measured[:, other].mean(axis=1))
        for one, other in islice(_halvings(measured.shape[1]), SPLITS)
    ]
    r = float(np.mean(halves)) if halves else math.nan
    return 2.0 * r / (1.0 + r)


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
    """Ways of taking two halves, each one once; a measurement may be left over."""
    half = count // 2
    if half == 0:
        return
    if count <= 6:
        for one in combinations(range(2 * half), half):
            if 0 in one:
                yield list(one), [i for i in range(2 * half) if i not in one]
        return
    rng = np.random.default_rng(0)
    while True:
        order = rng.permutation(count).tolist()
        yield order[:half], order[half : 2 * half]
