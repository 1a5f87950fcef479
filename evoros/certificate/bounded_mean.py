"""A confidence interval of the mean of bounded scores that allows for unseen scores.

Student's interval over five trials without a failure is much too narrow, because their spread does
not reveal future failures. This interval adds the minimum score to the observed scores for its
lower end, and the maximum score for its upper end. The scores are weighted by random weights
(n + 1,) that sum to 1 (uniform Dirichlet distribution). The ends are quantiles of the weighted
mean.

Source: Gaffke, Three test statistics for a nonparametric one-sided hypothesis on the mean of a
nonnegative variable, Mathematical Methods of Statistics 14, 2005; Learned-Miller and Thomas, A new
confidence interval for the mean of a bounded random variable, arXiv 1905.06208, 2019. For binary
scores it is the Clopper-Pearson interval (Biometrika 26, 1934). Its coverage is proven for binary
scores and conjectured otherwise; ``benchmarks/coverage`` tests it.
"""

import math
from collections.abc import Sequence

import numpy as np
import scipy

from evoros.base.arrays import Array
from evoros.certificate.rates import DIGITS, Bounds

LOWER_SHARE = 0.8
"""Share of the error rate at the lower end, because failed missions are rare and cost most."""
_GRID = np.linspace(0.0, 7.0, 80)
_STEPS, _WEIGHTS = np.sinh(_GRID), np.cosh(_GRID) * (_GRID[1] - _GRID[0])
_WEIGHTS[0] /= 2


def bound_mean(
    scores: Sequence[float], lowest: float, highest: float, confidence: float, repeats: int = 1
) -> Bounds:
    """Return an interval that contains the mean score with at least the confidence.

    ``scores`` are independent, lie between ``lowest`` and ``highest``, and may have any
    distribution. Their means may differ by kind (for example by world) if the number of each kind
    is fixed; the interval then covers the mean over the kinds. Without scores, it extends from
    ``lowest`` to ``highest``. With ``repeats``, each score counts that number of times.
    """
    values = np.asarray(scores, float)
    error = 1 - confidence
    low = _find_quantile(values, lowest, error * LOWER_SHARE, repeats)
    high = -_find_quantile(-values, -highest, error * (1 - LOWER_SHARE), repeats)
    return round(low, DIGITS), round(high, DIGITS)


def guess_highest(scores: Sequence[float], best: float) -> float:
    """Return an assumed maximum score for a fitness without a maximum.

    It exceeds the ``best`` score of any design by as much as that exceeds the median of ``scores``.
    The interval then does not allow for missions that go much better than any observed.
    """
    top = max(best, *scores)
    return 2 * top - float(np.median(scores))


def _find_quantile(values: Array, end: float, chance: float, repeats: int) -> float:
    """Return a quantile of the weighted mean of the values (n,) and of an ``end`` below them."""
    distinct, places = np.unique(np.append(end, values), return_inverse=True)
    if len(distinct) == 1 or distinct[0] < end:
        return float(distinct[0])
    counts = repeats * np.bincount(places).astype(np.float64)
    counts[0] -= repeats - 1  # the end counts once
    scale = float(distinct[-1] - end)
    shares = (distinct - end) / scale

    def excess(share: float) -> float:
        return math.log(max(_find_chance(shares - share, counts), 1e-300) / chance)

    most = float(shares @ counts / counts.sum())
    least = most
    while excess(least) > 0:
        least /= 2
    root = scipy.optimize.brentq(excess, least, 2 * least if least < most else 1.0, xtol=1e-9)
    return end + scale * float(root)


def _find_chance(rates: Array, counts: Array) -> float:
    """Return the probability that a weighted sum of exponential variables is at most 0.

    ``rates`` (n,) are the weights, with both signs, and ``counts`` (n,) the number of variables per
    weight. The moment-generating function is integrated (Bromwich) along a line through its saddle
    point, left of the pole at 0.
    """
    edge = 1 / float(rates[0])
    spread = 1 / math.sqrt(float(counts @ (rates * rates)))

    def slope(place: float) -> float:
        return float(counts @ (rates / (1 - rates * place)))

    saddle, outside = 0.0, edge * (1 - 1e-12)
    if slope(saddle) > 0:
        saddle = scipy.optimize.brentq(slope, outside, saddle, xtol=1e-12 * -edge)
    line = min(saddle, max(-spread / 2, edge / 2))
    turned = rates / (1 - rates * line)
    step = 1 / math.sqrt(float(counts @ (turned * turned)))
    places = line + 1j * step * _STEPS
    logs = -(np.log(1 - places[:, np.newaxis] * rates) @ counts)
    return float(_WEIGHTS @ np.real(np.exp(logs) / -places)) * step / math.pi
