"""Intervals of effect sizes: of A12, and of differences of means in a design of factors."""

from collections.abc import Sequence

import numpy as np
import scipy

from evoros.base.arrays import Array

from .small_samples import LEVEL, Interval, Sample, a12, magnitude

MIN_NAMED = 5
"""With fewer values on a side, the interval of A12 spans most magnitudes, and none is named."""


def a12_interval(x: Sample, y: Sample) -> Interval:
    """Return A12 and its interval, by method 5 of Newcombe (2006), Stat. Med. 25, 559-573.

    The interval contains the values from which A12 is no more than 1.96 standard errors away. The
    standard error is from Hanley and McNeil (1982), with the mean of both sizes for each. Unlike
    a bootstrapped one, it has a width at 0 and 1.
    """
    value, m, n = a12(x, y), len(x), len(y)
    z = float(scipy.stats.norm.ppf(1 - LEVEL / 2))

    def excess(p: float) -> float:
        others = ((m + n) / 2 - 1) * ((1 - p) / (2 - p) + p / (1 + p))
        return (value - p) ** 2 - z * z * p * (1 - p) * (1 + others) / (m * n)

    inside = min(max(value, 1e-9), 1 - 1e-9)  # at 0 and 1, A12 itself is a root
    low = float(scipy.optimize.brentq(excess, 0.0, inside)) if value > 0 else 0.0
    high = float(scipy.optimize.brentq(excess, inside, 1.0)) if value < 1 else 1.0
    return Interval(value, low, high)


def name_magnitude(x: Sample, y: Sample) -> str:
    """Name the magnitude of A12; '' if a side has fewer than ``MIN_NAMED`` values."""
    return magnitude(a12(x, y)) if min(len(x), len(y)) >= MIN_NAMED else ""


def contrast_interval(cells: Sequence[Sample], weights: Sample) -> Interval:
    """Return a weighted sum of the means of cells and its interval; no bounds for single values.

    Cells may differ in size and variance (Welch 1947, Biometrika 34, 28-35).
    """
    samples = [np.asarray(cell, float) for cell in cells]
    factors: Array = np.asarray(weights, float)
    value = float(sum(w * x.mean() for w, x in zip(factors, samples, strict=True)))
    if min(x.size for x in samples) < 2:
        return Interval(value)
    parts = [w * w * x.var(ddof=1) / x.size for w, x in zip(factors, samples, strict=True)]
    total = float(sum(parts))
    if total == 0:
        return Interval(value, value, value)
    freedom = total**2 / sum(p * p / (x.size - 1) for p, x in zip(parts, samples, strict=True))
    half = float(scipy.stats.t.ppf(1 - LEVEL / 2, freedom)) * total**0.5
    return Interval(value, value - half, value + half)
