"""Statistics of small samples of replicates: tests, corrections, effect sizes, intervals.

Every function gives the same number for the same input: what is drawn is drawn from a generator
with a fixed seed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np
from scipy import stats

from evoros.base.arrays import Array

LEVEL = 0.05
"""Below it a p is called significant; intervals cover 1 - LEVEL."""
RESAMPLES, SEED, CELLS = 9999, 20181, 1_000_000
MOST_SPLITS = 20_000
"""Ways to split two samples with equal values that are tried one by one."""
MOST_PAIRS = 30_000
"""Pairs of values of two samples up to which the test is exact: of more it takes many seconds."""
MAGNITUDES = ((0.21, "large"), (0.14, "medium"), (0.06, "small"), (0.0, "negligible"))
"""By the distance of A12 from 0.5: Vargha and Delaney (2000), J. Educ. Behav. Stat. 25, 101-132."""


@dataclass(frozen=True)
class Interval:
    """An estimate and the ends of its interval; NaN where there is too little to resample."""

    value: float
    low: float
    high: float


def mann_whitney(x: Sequence[float] | Array, y: Sequence[float] | Array) -> float:
    """The two-sided p of the Mann-Whitney U test (Mann and Whitney 1947).

    Exact without equal values, but for very large samples; with some, exact over all splits of
    small samples. Else by the normal approximation, corrected for ties and continuity: in small
    samples that one can fall below any p that is possible.
    """
    x, y = np.asarray(x, float), np.asarray(y, float)
    tied = np.unique([*x, *y]).size < x.size + y.size
    if tied and comb(x.size + y.size, x.size) <= MOST_SPLITS:
        return _all_splits(x, y)
    method = "asymptotic" if tied or x.size * y.size > MOST_PAIRS else "exact"
    return float(stats.mannwhitneyu(x, y, alternative="two-sided", method=method).pvalue)


def _all_splits(x: Array, y: Array) -> float:
    ranks = stats.rankdata([*x, *y])  # whole and half numbers: their sums are exact
    own = ranks[: x.size].sum()
    sums = np.array(list(combinations(ranks, x.size))).sum(axis=1)
    return min(1.0, 2 * float(min(np.mean(sums <= own), np.mean(sums >= own))))


def holm(p: Sequence[float] | Array) -> list[float]:
    """The p of a family of tests, adjusted so that each may be compared with ``LEVEL`` by itself.

    Holm (1979), Scand. J. Stat. 6, 65-70: the i-th smallest of n times n + 1 - i, never below a
    smaller one's, at most 1. In the order of ``p``.
    """
    raw = np.asarray(p, float)
    order = np.argsort(raw)
    stepped = np.maximum.accumulate(raw[order] * np.arange(raw.size, 0, -1))
    adjusted = np.empty_like(raw)
    adjusted[order] = np.minimum(stepped, 1.0)
    return [float(value) for value in adjusted]


def a12(x: Sequence[float] | Array, y: Sequence[float] | Array) -> float:
    """How likely a value of ``x`` is greater than one of ``y``, equal ones counted half.

    Vargha and Delaney (2000); 0.5: neither tends to be greater.
    """
    a, b = np.asarray(x, float)[:, None], np.asarray(y, float)
    return float(np.mean((a > b) + 0.5 * (a == b)))


def magnitude(effect: float) -> str:
    """What Vargha and Delaney (2000) call an A12: negligible, small, medium or large."""
    away = round(abs(effect - 0.5), 9)  # 0.44 and 0.56 are the same, but for the last bit
    return next(name for least, name in MAGNITUDES if away >= least)


def median_interval(values: Sequence[float] | Array) -> Interval:
    """The median and its bootstrap interval.

    It never leaves the sample: of fewer than six values even their whole range covers the
    population's median in less than 95 % of samples (1 - 2 ** (1 - n)).
    """
    return _bootstrap(lambda drawn: np.median(drawn[0], axis=-1), values)


def mean_interval(values: Sequence[float] | Array) -> Interval:
    """The mean and its bootstrap interval."""
    return _bootstrap(lambda drawn: drawn[0].mean(axis=-1), values)


def spearman(x: Sequence[float] | Array, y: Sequence[float] | Array) -> Interval:
    """Spearman's rank correlation of pairs, and its bootstrap interval.

    NaN where all values of one side are equal; resamples of which that is true do not count.
    """
    return _bootstrap(_rank_correlation, x, y)


def share_interval(count: int, of: int) -> Interval:
    """A share, and Wilson's interval of it (Wilson 1927, J. Am. Stat. Assoc. 22, 209-212)."""
    if not of:
        return Interval(np.nan, np.nan, np.nan)
    ends = stats.binomtest(count, of).proportion_ci(1 - LEVEL, method="wilson")
    return Interval(count / of, float(ends.low), float(ends.high))


def fisher(count: int, of: int, other_count: int, of_others: int) -> float:
    """The two-sided p of Fisher's exact test of two shares; NaN: one is of nothing."""
    if not of or not of_others:
        return np.nan
    table = [[count, of - count], [other_count, of_others - other_count]]
    return float(stats.fisher_exact(table).pvalue)


def ratio_interval(parts: Sequence[float] | Array, wholes: Sequence[float] | Array) -> Interval:
    """The sum of ``parts`` over the sum of ``wholes``, a value of each from every replicate.

    Whole replicates are resampled: what belongs to one is not taken as independent.
    """
    of = np.asarray([parts, wholes], float)
    if of.shape[1] == 1:
        return Interval(float(_ratio(of)), np.nan, np.nan)
    return _bootstrap(_ratio, *of)


def least_p(m: int, n: int) -> float:
    """The least p that the exact two-sided Mann-Whitney test of m and n values can give."""
    return min(1.0, 2 / comb(m + n, n))


def least_replicates(comparisons: int) -> int:
    """Values that each sample needs, so that one p can fall below ``LEVEL`` after ``holm``."""
    n = 1
    while comparisons * least_p(n, n) >= LEVEL:
        n += 1
    return n


def _bootstrap(statistic: Callable[[Array], Array], *samples: Sequence[float] | Array) -> Interval:
    """The percentile interval (Efron 1979) of a statistic of samples whose values belong together.

    ``statistic`` takes (samples, ..., n) and gives (...). Not BCa: its acceleration comes from the
    jackknife, which is inconsistent for a median, and it is undefined where all resamples agree.
    """
    values = np.asarray(samples, float)
    n = values.shape[1]
    if n < 2:
        only = float(values[0, 0]) if n and len(values) == 1 else np.nan
        return Interval(only, np.nan, np.nan)
    picked = np.random.default_rng(SEED).integers(n, size=(RESAMPLES, n))
    value, some = float(statistic(values)), max(1, CELLS // n)  # at a time: memory stays flat
    parts = [statistic(values[:, picked[i : i + some]]) for i in range(0, RESAMPLES, some)]
    drawn = np.concatenate(parts)
    known = drawn[~np.isnan(drawn)]
    if not known.size:
        return Interval(value, np.nan, np.nan)
    low, high = np.quantile(known, [LEVEL / 2, 1 - LEVEL / 2])
    return Interval(value, float(low), float(high))


def _ratio(drawn: Array) -> Array:
    """Of (2, ..., n) the ratio of the sums, (...); NaN where the second is 0."""
    part, whole = drawn.sum(axis=-1)
    return np.asarray(part / np.where(whole == 0, np.nan, whole))


def _rank_correlation(pairs: Array) -> Array:
    """Of (2, ..., n) the correlation of the ranks, (...); NaN where one side is constant."""
    ranks = stats.rankdata(pairs, axis=-1)
    x, y = ranks - ranks.mean(axis=-1, keepdims=True)
    with np.errstate(invalid="ignore"):  # a constant side: 0 / 0
        return np.asarray((x * y).sum(axis=-1) / np.sqrt((x * x).sum(-1) * (y * y).sum(-1)))
