"""A two-sample test, and the effect size A12 with its interval, based on one statistic.

The statistic (Brunner and Munzel 2000, Biom. J. 42, 17-25) is A12 minus 0.5, divided by a standard
error that lets the samples differ in spread and size. Its distribution comes from permutations
(Neubert and Brunner 2007, Comput. Stat. Data Anal. 51, 5192-5204) on the logit scale (Pauly,
Asendorpf and Konietschke 2016, Biom. J. 58, 1319-1337), so that test and interval agree: p is below
``LEVEL`` if the interval excludes 0.5. The converse may fail for ties, or for few values that
separate completely. The results depend only on the ranks, not on the order of the values or of the
samples.
"""

from functools import lru_cache
from math import comb, inf
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from evoros.base.arrays import Array

from .small_samples import CELLS, LEVEL, RESAMPLES, SEED, Interval, Sample

TEST = "permuted Brunner-Munzel test"
# Four values separate completely by chance in up to one of eight pairs of samples (A12 0.5).
MIN_VALUES = 5  # sample size below which p is 1
MAX_SPLITS = 20_000  # maximum number of splits to enumerate; of more, a sample is drawn
MAX_PERMUTED = 400  # maximum number of values to permute; Student's distribution is used above
DIGITS = 9  # decimals to which the statistic is rounded, so that ties agree on every processor
Places = NDArray[np.int64]


class _Ranking(NamedTuple):
    """A12, its standard error and the error's degrees of freedom, as arrays of one shape."""

    a12: Array
    error: Array
    freedom: Array

    @property
    def statistic(self) -> Array:
        """The logit of A12 divided by its standard error."""
        return np.asarray(np.round(_logit(self.a12) / self._logit_error, DIGITS))

    @property
    def _logit_error(self) -> Array:
        return np.asarray(self.error / (self.a12 * (1 - self.a12)))

    def move(self, quantile: float) -> float:
        """Return the null-hypothesis A12 at which the statistic equals ``quantile``."""
        end = float(scipy.special.expit(_logit(self.a12) - quantile * self._logit_error))
        return round(end, DIGITS - 1)  # rounded as the statistic is


def brunner_munzel(x: Sample, y: Sample) -> float:
    """Return the two-sided p-value of the null hypothesis that A12 is 0.5.

    The p-value is exact for equal distributions if all splits are enumerated; for unequal spreads,
    it falls below 0.05 in 2 to 7 % of cases. It is 1 for samples of fewer than ``MIN_VALUES``
    values.
    """
    if min(len(x), len(y)) < MIN_VALUES:
        return 1.0
    ranking, permuted = _rank(x, y), _permute_samples(x, y)
    value = float(ranking.statistic)
    if permuted is None:
        return float(2 * scipy.special.stdtr(ranking.freedom, -abs(value)))
    drawn = _count_drawn(len(x), len(y))
    above = permuted.size - np.searchsorted(permuted, value) + drawn
    below = np.searchsorted(permuted, value, side="right") + drawn
    return min(1.0, 2 * float(min(above, below)) / (permuted.size + drawn))


def a12(x: Sample, y: Sample) -> float:
    """Return the probability that a value of ``x`` exceeds a value of ``y``; ties count half."""
    a, b = np.asarray(x, float)[:, None], np.asarray(y, float)
    return float(np.mean((a > b) + 0.5 * (a == b)))


def a12_interval(x: Sample, y: Sample) -> Interval:
    """Return A12 (Vargha and Delaney 2000, J. Educ. Behav. Stat. 25, 101-132) with its interval.

    If samples are completely separated or all equal, k independent pairs agree, where k is the
    smaller sample size. The probability of this is at most A12 ** k, which bounds A12. With some
    ties, the interval is at least as wide as Student's with k - 1 degrees of freedom, because
    permutations of ties vary too little if the samples differ.
    """
    value, few = a12(x, y), min(len(x), len(y))
    if value in (0.0, 1.0) or np.ptp([*x, *y]) == 0:
        reach = (LEVEL / 2) ** (1 / few)
        return Interval(value, reach * value, 1 - reach * (1 - value))
    if few == 1:
        return Interval(value, 0.0, 1.0)
    ranking, permuted = _rank(x, y), _permute_samples(x, y)
    if permuted is None:
        high = float(scipy.special.stdtrit(ranking.freedom, 1 - LEVEL / 2))
        return Interval(value, ranking.move(high), ranking.move(-high))
    low, high = _find_critical(permuted, _count_drawn(len(x), len(y)), LEVEL)
    if np.unique([*x, *y]).size < len(x) + len(y):
        student = float(scipy.special.stdtrit(min(float(ranking.freedom), few - 1), 1 - LEVEL / 2))
        low, high = min(low, -student), max(high, student)
    return Interval(value, ranking.move(high), ranking.move(low))


def compute_statistics(x: Array, y: Array) -> Array:
    """Return the statistics (k,) of pairs of samples (k, m) and (k, n) without ties."""
    order = np.argsort(np.hstack([x, y]), axis=1)
    ends = np.arange(1, order.shape[1] + 1)
    return _compare(order < x.shape[1], ends - 1, ends).statistic


def find_critical(n: int, level: float) -> tuple[float, float]:
    """Return the critical values of the statistic at ``level``, for two samples of n values."""
    if n < MIN_VALUES:
        return -inf, inf
    ends = np.arange(1, 2 * n + 1)
    return _find_critical(_permute(n, ends.tobytes()), _count_drawn(n, n), level)


def minimum_p(m: int, n: int) -> float:
    """Return the minimum possible p-value for samples of m and n values."""
    drawn = 2 / (RESAMPLES + 1) if _count_drawn(m, n) else 0.0
    return 1.0 if min(m, n) < MIN_VALUES else max(drawn, 2 / comb(m + n, n))


def minimum_replicates(comparisons: int) -> int:
    """Return the minimum sample size for which p can fall below ``LEVEL`` after ``holm``."""
    n = MIN_VALUES
    while comparisons * minimum_p(n, n) >= LEVEL and not _count_drawn(n, n):
        n += 1
    return n


def _logit(share: Array) -> Array:
    return np.asarray(scipy.special.logit(share))


def _count_drawn(m: int, n: int) -> int:
    """Return the number of observed splits to add: 1 if splits are drawn, 0 if enumerated."""
    return int(comb(m + n, m) > MAX_SPLITS)


def _order(x: Sample, y: Sample) -> tuple[NDArray[np.bool_], Places, Places]:
    """Return a mask of the ordered pooled values that are from ``x``, and the end of each tie."""
    pooled = np.concatenate([np.asarray(x, float), np.asarray(y, float)])
    order = np.argsort(pooled)
    values = pooled[order]
    starts, ends = (np.searchsorted(values, values, side) for side in ("left", "right"))
    return order < len(x), starts, ends


def _rank(x: Sample, y: Sample) -> _Ranking:
    return _compare(*_order(x, y))


def _compare(first: NDArray[np.bool_], starts: Places, ends: Places) -> _Ranking:
    """Compare the first sample, a mask (..., m + n) over the ordered values, with the second."""
    # Doubled counts of lower values, with ties as half, are integers, so sums are exact.
    below = np.zeros((*first.shape[:-1], first.shape[-1] + 1), np.int64)
    np.cumsum(first, axis=-1, out=below[..., 1:])
    of_first = below[..., starts] + below[..., ends]
    sides = (first, starts + ends - of_first), (~first, of_first)
    m, n = (side.sum(axis=-1) for side, _ in sides)
    total, variances = np.zeros(m.shape), []
    for (side, counts), size, other in zip(sides, (m, n), (n, m), strict=True):
        counts = np.where(side, counts, 0)
        total = counts.sum(axis=-1) if side is first else total
        scatter = size * (counts**2).sum(axis=-1) - counts.sum(axis=-1) ** 2
        variances.append(scatter / (4 * size**2 * (size - 1) * other**2))
    square = variances[0] + variances[1]
    least = 0.5 / (m * n)  # treats the nearest two values of separated samples as tied
    parts = sum(part**2 / (size - 1) for part, size in zip(variances, (m, n), strict=True))
    with np.errstate(invalid="ignore"):  # separated samples give 0 / 0
        freedom = np.asarray(square**2 / parts)
    a12 = np.clip(total / (2 * m * n), least, 1 - least)
    return _Ranking(a12, np.sqrt(np.where(square > 0, square, 2 * least**2)), freedom)


def _permute_samples(x: Sample, y: Sample) -> Array | None:
    if len(x) + len(y) > MAX_PERMUTED:
        return None
    ends = _order(x, y)[2]
    if len(x) <= len(y):
        return _permute(len(x), ends.tobytes())
    return np.asarray(-_permute(len(y), ends.tobytes())[::-1])


@lru_cache(maxsize=256)
def _permute(m: int, ends_of_ties: bytes) -> Array:
    ends = np.frombuffer(ends_of_ties, np.int64)
    starts = np.searchsorted(ends, ends)

    def compute(first: Places, second: Places, axis: int = -1) -> Array:
        mask = np.zeros((*first.shape[:-1], ends.size), bool)
        np.put_along_axis(mask, first, True, axis=-1)
        return _compare(mask, starts, ends).statistic

    few = comb(ends.size, m) <= MAX_SPLITS
    result = scipy.stats.permutation_test(
        (np.arange(m), np.arange(m, ends.size)),
        compute,
        permutation_type="independent",
        vectorized=True,
        n_resamples=inf if few else RESAMPLES,
        batch=max(1, CELLS // ends.size),
        rng=np.random.default_rng(SEED),
    )
    return np.sort(result.null_distribution)


def _find_critical(permuted: Array, drawn: int, level: float) -> tuple[float, float]:
    """Return the lower and upper critical value for a level; infinite if there are none."""
    place = int(np.ceil(level / 2 * (permuted.size + drawn))) - 1 - drawn
    if place < 0:
        return -inf, inf
    return float(permuted[place]), float(permuted[-1 - place])
