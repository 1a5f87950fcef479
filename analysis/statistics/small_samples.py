"""Deterministic statistics of small samples: intervals, and corrections for multiple tests."""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.certificate.rates import bound_difference, bound_rate

LEVEL = 0.05  # significance level; intervals have a coverage of 1 - LEVEL
MIN_PAIRS = 10  # minimum number of pairs for an interval of a rank correlation
RESAMPLES, SEED = 9999, 20181
CELLS = 1_000_000  # maximum number of values resampled at a time, to limit memory
Numbers = NDArray[np.floating[Any]]
Sample = Sequence[float] | Numbers


@dataclass(frozen=True)
class Interval:
    """An estimate with the bounds of its interval, which are NaN for too few values."""

    value: float
    low: float = np.nan
    high: float = np.nan
    confidence: float = 1 - LEVEL

    def __neg__(self) -> "Interval":
        return Interval(-self.value, -self.high, -self.low, self.confidence)

    def write(self, form: str = ".2f") -> str:
        """Format the estimate with any known bounds, and with their coverage if below 1 - LEVEL."""
        short = f"; {100 * self.confidence:.0f} %" if self.confidence < 1 - LEVEL else ""
        bounds = f" [{self.low:{form}}, {self.high:{form}}{short}]" if self.low <= self.high else ""
        return f"{self.value:{form}}{bounds}"


NOTHING = Interval(np.nan)  # an unknown value


def choose_form(values: Sample) -> str:
    """Return a number format: two decimals, fewer for large values, more for small values."""
    size = float(np.abs(np.asarray(values, float)).max())
    if 0 < size < 0.1:
        return ".3g"
    return ".2f" if size < 1e3 else ".1f" if size < 1e4 else ".0f"


def holm(p: Sample) -> list[float]:
    """Adjust p-values for multiple tests at ``LEVEL`` (Holm 1979, Scand. J. Stat. 6)."""
    raw = np.asarray(p, float)
    order = np.argsort(raw)
    stepped = np.maximum.accumulate(raw[order] * np.arange(raw.size, 0, -1))
    adjusted = np.empty_like(raw)
    adjusted[order] = np.minimum(stepped, 1.0)
    return [float(value) for value in adjusted]


def median_interval(values: Sample) -> Interval:
    """Return the median with its exact interval (Thompson 1936, Ann. Math. Stat. 7, 122-128).

    For fewer than six values, the interval is the full range and covers less than 95 %.
    """
    ordered = np.sort(np.asarray(values, float))
    n = ordered.size
    if n < 2:
        return Interval(float(ordered[0])) if n else NOTHING
    place = max(0, int(scipy.stats.binom.ppf(LEVEL / 2, n, 0.5)) - 1)
    confidence = 1 - 2 * float(scipy.stats.binom.cdf(place, n, 0.5))
    low, high = float(ordered[place]), float(ordered[n - 1 - place])
    return Interval(float(np.median(ordered)), low, high, min(confidence, 1 - LEVEL))


def mean_interval(values: Sample) -> Interval:
    """Return the mean with its bootstrap interval, expanded for small samples."""
    return _bootstrap(np.mean, values, tail=expand_tail(len(values)))


def spearman(x: Sample, y: Sample) -> Interval:
    """Return Spearman's rank correlation with its interval; NaN if a sample is constant."""
    if len(x) < MIN_PAIRS:
        return Interval(float(_rank_correlation(np.asarray(x), np.asarray(y))))
    return _bootstrap(_rank_correlation, x, y)


def share_interval(count: int, total: int) -> Interval:
    """Return a share with its exact interval (see ``bound_rate``); NaN if the total is 0."""
    return Interval(count / total, *bound_rate(count, total, 1 - LEVEL)) if total else NOTHING


def share_difference(count: int, total: int, other_count: int, other_total: int) -> Interval:
    """Return the difference between two shares with its interval; NaN if a total is 0."""
    if not total or not other_total:
        return NOTHING
    value = count / total - other_count / other_total
    bounds = bound_difference((count, total), (other_count, other_total), 1 - LEVEL)
    return Interval(value, *bounds)


def fisher(count: int, total: int, other_count: int, other_total: int) -> float:
    """Return the two-sided p-value of Fisher's exact test on two shares; NaN if a total is 0."""
    if not total or not other_total:
        return np.nan
    table = [[count, total - count], [other_count, other_total - other_count]]
    return float(scipy.stats.fisher_exact(table).pvalue)


def ratio_interval(parts: Sample, wholes: Sample) -> Interval:
    """Return the ratio of two sums over replicates, with an expanded bootstrap interval."""
    return _bootstrap(_ratio, parts, wholes, tail=expand_tail(len(parts)))


def expand_tail(n: int) -> float:
    """Return the fraction of resamples beyond each bound of an interval for the mean of n values.

    Plain percentile intervals are too narrow for small n (Hesterberg 2015, Am. Stat. 69, 371).
    """
    if n < 2:
        return LEVEL / 2
    quantile = float(scipy.special.stdtrit(n - 1, 1 - LEVEL / 2))
    return float(scipy.special.ndtr(-((n / (n - 1)) ** 0.5) * quantile))


def _bootstrap(
    statistic: Callable[..., Any], *samples: Sample, tail: float = LEVEL / 2
) -> Interval:
    """Return the percentile interval (Efron 1979) with a fraction ``tail`` beyond each bound."""
    # BCa intervals are undefined if all resamples agree, and inconsistent for medians.
    values = [np.asarray(sample, float) for sample in samples]
    n = len(values[0])
    if n < 2:
        return Interval(float(statistic(*values, axis=-1))) if n else NOTHING
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", scipy.stats.DegenerateDataWarning)  # NaN resamples warn
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
    part, whole = parts.sum(axis=axis), wholes.sum(axis=axis)
    return np.asarray(part / np.where(whole == 0, np.nan, whole))


def _rank_correlation(x: Array, y: Array, axis: int = -1) -> Array:
    """Correlate ranks over the last axis: exactly 1 for equal orders, NaN for a constant."""
    a, b = (
        ranks - ranks.mean(axis=axis, keepdims=True)
        for ranks in (scipy.stats.rankdata(side, axis=axis) for side in (x, y))
    )
    with np.errstate(invalid="ignore"):  # a constant sample gives 0 / 0
        return np.asarray((a * b).sum(axis) / np.sqrt((a * a).sum(axis) * (b * b).sum(axis)))


class Shortfall(NamedTuple):
    """Lowest coverage or highest error rate [%] over all sample sizes; None if nominal."""

    usual: int | None  # worst distribution without outliers
    outlier: int | None = None  # distribution with one outlier in a hundred values


INTERVALS: Mapping[str, Shortfall] = {
    "mean, bootstrap": Shortfall(84, 12),
    "ratio of sums, bootstrap": Shortfall(None, 91),
    "mean, Student": Shortfall(82, 28),
    "difference of means, Welch": Shortfall(82, 47),
    "standard deviation": Shortfall(41, 0),
    "change in completion time, bootstrap": Shortfall(89),
}
"""Actual coverage of 95 % intervals, keyed as in ``docs/coverage.md``."""
TESTS: Mapping[str, Shortfall] = {
    "a factor has an effect": Shortfall(12, 8),
    "two factors interact": Shortfall(9, 8),
    "paired values change (sign-flip test)": Shortfall(12),
}
"""Actual error rates of tests at the 5 % level, keyed as in ``docs/coverage.md``."""


def describe_shortfalls(*names: str) -> Iterator[str]:
    """Yield a line on the intervals among ``names``, and a line on the tests."""
    lines = (
        ("these 95 % intervals may cover the true value in fewer than 95 % of cases", INTERVALS),
        ("these tests may find an effect that does not exist in more than 5 % of cases", TESTS),
    )
    for text, known in lines:
        if short := [f"{name}: {_write(known[name])}" for name in names if name in known]:
            yield f"{text} (docs/coverage.md): {'; '.join(short)}"


def _write(shortfall: Shortfall) -> str:
    parts = ("with skewed values", shortfall.usual), ("with one outlier in 100", shortfall.outlier)
    return ", ".join(f"{share} % {when}" for when, share in parts if share is not None)
