"""Statistics of small samples of replicates: tests, corrections, effect sizes, intervals.

Every function is deterministic: resampling uses a generator with a fixed seed.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from evoros.base.arrays import Array

LEVEL = 0.05
"""A p below it is significant; intervals cover 1 - LEVEL."""
RESAMPLES, SEED = 9999, 20181
CELLS = 1_000_000
"""Values that are resampled at a time; a limit of memory."""
MAX_SPLITS = 20_000
"""Maximum number of splits of two samples with ties that are enumerated."""
MAX_PAIRS = 30_000
"""Maximum number of pairs of values for the exact test; more would take many seconds."""
MAGNITUDES = ((0.21, "large"), (0.14, "medium"), (0.06, "small"), (0.0, "negligible"))
"""By the distance of A12 from 0.5: Vargha and Delaney (2000), J. Educ. Behav. Stat. 25, 101-132."""
Numbers = NDArray[np.floating[Any]]
Sample = Sequence[float] | Numbers


@dataclass(frozen=True)
class Interval:
    """An estimate and the bounds of its interval; NaN if there are too few values to resample."""

    value: float
    low: float = np.nan
    high: float = np.nan

    def __neg__(self) -> "Interval":
        return Interval(-self.value, -self.high, -self.low)

    def write(self, form: str = ".2f") -> str:
        """Write the estimate, and its bounds if they are known."""
        bounds = f" [{self.low:{form}}, {self.high:{form}}]" if self.low <= self.high else ""
        return f"{self.value:{form}}{bounds}"


NOTHING = Interval(np.nan)
"""An unknown value."""


def choose_form(values: Sample) -> str:
    """Choose a format of values: two decimals, or fewer if the values are large."""
    size = float(np.abs(np.asarray(values, float)).max())
    return ".2f" if size < 1e3 else ".1f" if size < 1e4 else ".0f"


def mann_whitney(x: Sample, y: Sample) -> float:
    """Return the two-sided p of the Mann-Whitney U test (Mann and Whitney 1947).

    It is exact, except for very large samples and large ones with ties, which get the normal
    approximation. SciPy's exact method ignores ties and its permutation method rejects single
    values, so that small samples with ties are enumerated here.
    """
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    tied = np.unique([*x, *y]).size < x.size + y.size
    if tied and comb(x.size + y.size, x.size) <= MAX_SPLITS:
        return _enumerate_splits(x, y)
    method = "asymptotic" if tied or x.size * y.size > MAX_PAIRS else "exact"
    return float(scipy.stats.mannwhitneyu(x, y, alternative="two-sided", method=method).pvalue)


def _enumerate_splits(x: Numbers, y: Numbers) -> float:
    ranks = scipy.stats.rankdata([*x, *y])  # multiples of 0.5, so that their sums are exact
    observed = ranks[: x.size].sum()
    sums = np.array(list(combinations(ranks, x.size))).sum(axis=1)
    return min(1.0, 2 * float(min(np.mean(sums <= observed), np.mean(sums >= observed))))


def holm(p: Sample) -> list[float]:
    """Adjust the p of a family of tests so that each may be compared with ``LEVEL`` by itself.

    Holm (1979), Scand. J. Stat. 6, 65-70: the i-th smallest of n is multiplied by n + 1 - i, is at
    least the adjusted p of the smaller ones, and at most 1. The order of ``p`` is kept. SciPy has
    corrections of the false discovery rate only.
    """
    raw = np.asarray(p, float)
    order = np.argsort(raw)
    stepped = np.maximum.accumulate(raw[order] * np.arange(raw.size, 0, -1))
    adjusted = np.empty_like(raw)
    adjusted[order] = np.minimum(stepped, 1.0)
    return [float(value) for value in adjusted]


def a12(x: Sample, y: Sample) -> float:
    """Return the probability that a value of ``x`` exceeds one of ``y``; ties count half."""
    a, b = np.asarray(x, float)[:, None], np.asarray(y, float)
    return float(np.mean((a > b) + 0.5 * (a == b)))


def magnitude(effect: float) -> str:
    """Return what Vargha and Delaney (2000) call an A12: negligible, small, medium or large."""
    distance = round(abs(effect - 0.5), 9)  # 0.44 and 0.56 differ in the last bit
    return next(name for minimum, name in MAGNITUDES if distance >= minimum)


def median_interval(values: Sample) -> Interval:
    """Return the median and its bootstrap interval; too narrow for fewer than six values."""
    return _bootstrap(np.median, values)


def mean_interval(values: Sample) -> Interval:
    """Return the mean and its bootstrap interval, expanded for few values."""
    return _bootstrap(np.mean, values, tail=_expand_tail(len(values)))


def spearman(x: Sample, y: Sample) -> Interval:
    """Return Spearman's rank correlation of pairs and its interval; NaN for a constant side."""
    return _bootstrap(_rank_correlation, x, y)


def share_interval(count: int, total: int) -> Interval:
    """Return a share and its Wilson interval (Wilson 1927, J. Am. Stat. Assoc. 22, 209-212)."""
    if not total:
        return NOTHING
    bounds = scipy.stats.binomtest(count, total).proportion_ci(1 - LEVEL, method="wilson")
    return Interval(count / total, float(bounds.low), float(bounds.high))


def share_difference(count: int, total: int, other_count: int, other_total: int) -> Interval:
    """Return the difference of two shares and its interval.

    By the hybrid of Wilson intervals, method 10 of Newcombe (1998), Stat. Med. 17, 873-890.
    """
    if not total or not other_total:
        return NOTHING
    one, other = share_interval(count, total), share_interval(other_count, other_total)
    value = one.value - other.value
    below = np.hypot(one.value - one.low, other.high - other.value)
    above = np.hypot(one.high - one.value, other.value - other.low)
    return Interval(value, float(value - below), float(value + above))


def fisher(count: int, total: int, other_count: int, other_total: int) -> float:
    """Return the two-sided p of Fisher's exact test of two shares; NaN if a total is 0."""
    if not total or not other_total:
        return np.nan
    table = [[count, total - count], [other_count, other_total - other_count]]
    return float(scipy.stats.fisher_exact(table).pvalue)


def ratio_interval(parts: Sample, wholes: Sample) -> Interval:
    """Return the ratio of the sums and its bootstrap interval, expanded for few values.

    Replicates are drawn as a unit.
    """
    return _bootstrap(_ratio, parts, wholes, tail=_expand_tail(len(parts)))


def minimum_p(m: int, n: int) -> float:
    """Return the minimum p of the exact two-sided Mann-Whitney test of m and n values."""
    return min(1.0, 2 / comb(m + n, n))


def minimum_replicates(comparisons: int) -> int:
    """Return how many values each sample needs for a p below ``LEVEL`` after ``holm``."""
    n = 1
    while comparisons * minimum_p(n, n) >= LEVEL:
        n += 1
    return n


def _expand_tail(n: int) -> float:
    """Return the share of resamples beyond each bound, so that a mean of n values is covered.

    Resampled means of n values scatter less than means do, by the factor sqrt((n - 1) / n), and
    normal quantiles know of no degrees of freedom: of six normal values, the plain interval covers
    the mean in 84 % of samples. The expanded percentile interval allows for both (Hesterberg 2015,
    Am. Stat. 69, 371-386).
    """
    if n < 2:
        return LEVEL / 2
    quantile = float(scipy.special.stdtrit(n - 1, 1 - LEVEL / 2))
    return float(scipy.special.ndtr(-((n / (n - 1)) ** 0.5) * quantile))


def _bootstrap(
    statistic: Callable[..., Any], *samples: Sample, tail: float = LEVEL / 2
) -> Interval:
    """Return the percentile interval (Efron 1979) of a statistic of paired samples.

    ``tail`` is the share of resamples beyond each bound. Resamples in which the statistic is NaN
    are dropped. BCa intervals are not used: their acceleration comes from the jackknife, which is
    inconsistent for a median, and they are undefined if all resamples agree.
    """
    values = [np.asarray(sample, float) for sample in samples]
    n = len(values[0])
    if n < 2:
        return Interval(float(statistic(*values, axis=-1))) if n else NOTHING
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", scipy.stats.DegenerateDataWarning)  # about NaN resamples
        value = float(statistic(*values, axis=-1))
        resampled: Array = scipy.stats.bootstrap(
            values,
            statistic,
            paired=True,
            vectorized=True,
            n_resamples=RESAMPLES,
            batch=max(1, CELLS // n),
            method="percentile",
            rng=np.random.default_rng(SEED),
        ).bootstrap_distribution
    known = resampled[~np.isnan(resampled)]
    if not known.size:
        return Interval(value)
    low, high = np.quantile(known, [tail, 1 - tail])
    return Interval(value, float(low), float(high))


def _ratio(parts: Array, wholes: Array, axis: int = -1) -> Array:
    """Divide the sums over the last axis; NaN if the sum of ``wholes`` is 0."""
    part, whole = parts.sum(axis=axis), wholes.sum(axis=axis)
    return np.asarray(part / np.where(whole == 0, np.nan, whole))


def _rank_correlation(x: Array, y: Array, axis: int = -1) -> Array:
    """Correlate the ranks over the last axis; NaN if one side is constant.

    ``scipy.stats.spearmanr`` takes one pair of samples at a time, and ``pearsonr`` of ranks is not
    exactly 1 for equal orders.
    """
    a, b = (
        ranks - ranks.mean(axis=axis, keepdims=True)
        for ranks in (scipy.stats.rankdata(side, axis=axis) for side in (x, y))
    )
    with np.errstate(invalid="ignore"):  # a constant side: 0 / 0
        return np.asarray((a * b).sum(axis) / np.sqrt((a * a).sum(axis) * (b * b).sum(axis)))
