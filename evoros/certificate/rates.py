"""Confidence intervals for rates, for differences between rates, and for means of bounded scores.

To allow for rare failures, the interval of a mean adds the minimum score to the observed scores for
its lower end, and the maximum score for its upper end. The ends are quantiles of the mean with
random weights (n + 1,) that sum to 1 (uniform Dirichlet distribution).

Source: Gaffke, Three test statistics for a nonparametric one-sided hypothesis on the mean of a
nonnegative variable, Mathematical Methods of Statistics 14, 2005; Learned-Miller and Thomas, A new
confidence interval for the mean of a bounded random variable, arXiv 1905.06208, 2019. For binary
scores, this is the Clopper-Pearson interval (Biometrika 26, 1934); otherwise the coverage is
conjectured, and ``benchmarks/coverage`` tests it.
"""

import math
from collections.abc import Sequence
from functools import cache

import numpy as np
import scipy

from evoros.base.arrays import Array
from evoros.certificate.roots import find_root

Bounds = tuple[float, float]
DIGITS = 6  # decimal places of results, equal on all processors


def bound_rate(successes: int, trials: int, confidence: float) -> Bounds:
    """Return a rate's exact interval (Clopper and Pearson 1934); NaN if there are no trials."""
    if not trials:
        return math.nan, math.nan
    failures, tail = trials - successes, (1 - confidence) / 2
    low = _find_rate(successes, trials, tail) if successes else 0.0
    high = _find_rate(successes + 1, trials, 1 - tail) if failures else 1.0
    return round(low, DIGITS), round(high, DIGITS)


def _find_rate(successes: int, trials: int, chance: float) -> float:
    """Return the rate at which at least ``successes`` successes have the probability ``chance``."""
    numbers = np.arange(successes, trials + 1)
    gammas = [math.lgamma(k + 1) + math.lgamma(trials - k + 1) for k in numbers.tolist()]
    ways = math.lgamma(trials + 1) - np.array(gammas)  # logarithms of binomial coefficients

    def excess(rate: float) -> float:
        logs = ways + numbers * math.log(rate) + (trials - numbers) * math.log1p(-rate)
        return float(np.exp(logs).sum()) - chance

    return find_root(excess, 1e-300, 1 - 2**-53, 1e-12)


def bound_difference(first: tuple[int, int], second: tuple[int, int], confidence: float) -> Bounds:
    """Return the interval of the difference first - second; both rates are (successes, trials).

    It excludes 0 if Fisher's exact test, one-sided at half the error rate, finds a difference.
    Source: Fay, Proschan and Brittain, Combining one-sample confidence procedures for inference in
    the two-sample case, Biometrics 71, 2015.
    """
    tail = (1 - confidence) / 2
    low, high = _bound_below(first, second, tail), -_bound_below(second, first, tail)
    return round(low, DIGITS), round(high, DIGITS)


def _bound_below(first: tuple[int, int], second: tuple[int, int], tail: float) -> float:
    """Return the lower end of an interval: a quantile of the difference of two Beta variables."""
    (successes, trials), (others, of) = first, second
    if not successes:
        return -bound_rate(others, of, 1 - 2 * tail)[1]
    places, weights = _list_chances()
    high = scipy.special.betaincinv(others + 1, of - others, places) if others < of else 1.0

    def excess(low: float) -> float:
        ends = np.clip(low + high, 0, 1)
        chances = scipy.special.betainc(successes, trials - successes + 1, ends)
        return float(np.sum(weights * chances)) - tail

    return find_root(excess, -1.0, 1.0, 1e-9)


@cache
def _list_chances() -> tuple[Array, Array]:
    """Return the probabilities at which quantiles are computed, and their integration weights."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    chances = (nodes + 1) ** 2 * (2 - nodes) / 4  # denser near 0 and 1, where quantiles are steep
    return chances, weights * 3 * (1 - nodes**2) / 4  # derivative of the substitution


def share_level(confidence: float, tests: int) -> float:
    """Return the confidence that each of the tests needs for a joint ``confidence``."""
    return 1 - (1 - confidence) / tests  # Bonferroni


LOWER_SHARE = 0.8  # share of the error rate for the lower end, because failures are costly
_GRID = np.linspace(0.0, 7.0, 80)
_STEPS, _AREAS = np.sinh(_GRID), np.cosh(_GRID) * (_GRID[1] - _GRID[0])
_AREAS[0] /= 2


def bound_mean(
    scores: Sequence[float], lowest: float, highest: float, confidence: float, repeats: int = 1
) -> Bounds:
    """Return an interval that contains the mean score with at least the given confidence.

    ``scores`` are independent, between ``lowest`` and ``highest``, and have any distribution. Their
    expected values may differ between kinds (for example worlds) if the number of each kind is
    fixed; the interval then covers the mean over the kinds. Without scores, it extends from
    ``lowest`` to ``highest``. Each score counts ``repeats`` times.
    """
    values = np.asarray(scores, float)
    error = 1 - confidence
    low = _find_quantile(values, lowest, error * LOWER_SHARE, repeats)
    high = -_find_quantile(-values, -highest, error * (1 - LOWER_SHARE), repeats)
    return round(low, DIGITS), round(high, DIGITS)


def guess_highest(scores: Sequence[float], best: float) -> float:
    """Return an assumed maximum score for a fitness without an upper bound."""
    top = max(best, *scores)
    return 2 * top - float(np.median(scores))


def _find_quantile(values: Array, end: float, chance: float, repeats: int) -> float:
    """Return a quantile of the weighted mean of the values (n,) and a value ``end`` below them."""
    distinct, places = np.unique(np.append(end, values), return_inverse=True)
    if len(distinct) == 1 or distinct[0] < end:
        return float(distinct[0])
    counts = repeats * np.bincount(places).astype(np.float64)
    counts[0] -= repeats - 1  # the end value is not repeated
    scale = float(distinct[-1] - end)
    shares = (distinct - end) / scale

    def excess(share: float) -> float:
        return math.log(max(_find_chance(shares - share, counts), 1e-300) / chance)

    most = float(shares @ counts / counts.sum())
    least = most
    while excess(least) > 0:
        least /= 2
    root = find_root(excess, least, 2 * least if least < most else 1.0, 1e-9)
    return end + scale * root


def _find_chance(rates: Array, counts: Array) -> float:
    """Return the probability that the sum of ``counts`` exponential variables per rate is <= 0."""
    # The moment-generating function is integrated (Bromwich) through its saddle point.
    edge = 1 / float(rates[0])
    spread = 1 / math.sqrt(float(counts @ (rates * rates)))

    def slope(place: float) -> float:
        return float(counts @ (rates / (1 - rates * place)))

    saddle, outside = 0.0, edge * (1 - 1e-12)
    if slope(saddle) > 0:
        saddle = find_root(slope, outside, saddle, 1e-12 * -edge)
    line = min(saddle, max(-spread / 2, edge / 2))
    turned = rates / (1 - rates * line)
    step = 1 / math.sqrt(float(counts @ (turned * turned)))
    places = line + 1j * step * _STEPS
    logs = -(np.log(1 - places[:, np.newaxis] * rates) @ counts)
    return float(_AREAS @ np.real(np.exp(logs) / -places)) * step / math.pi
