"""Confidence intervals of a rate, and of the difference of two rates."""

import math

import numpy as np
import scipy

Bounds = tuple[float, float]
DIGITS = 6
"""Decimal places of the results, so that they are the same on every processor."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(200)
_CHANCES = (_NODES + 1) ** 2 * (2 - _NODES) / 4  # denser at both ends, where quantiles are steep
_WEIGHTS = _WEIGHTS * 3 * (1 - _NODES**2) / 4  # chain rule of the change of variable


def bound_rate(successes: int, trials: int, confidence: float) -> Bounds:
    """Return the exact interval of a rate; NaN without trials.

    It contains the rate with at least the confidence for any rate and number of trials. Source:
    Clopper and Pearson, The use of confidence or fiducial limits illustrated in the case of the
    binomial, Biometrika 26, 1934.
    """
    if not trials:
        return math.nan, math.nan
    failures, tail = trials - successes, (1 - confidence) / 2
    low = scipy.special.betaincinv(successes, failures + 1, tail) if successes else 0.0
    high = scipy.special.betaincinv(successes + 1, failures, 1 - tail) if failures else 1.0
    return round(float(low), DIGITS), round(float(high), DIGITS)


def bound_difference(first: tuple[int, int], second: tuple[int, int], confidence: float) -> Bounds:
    """Return the interval of the first rate minus the second, each given as (successes, trials).

    It excludes 0 if Fisher's exact test, one-sided at half the error rate, finds a difference. With
    common random numbers it is conservative. Source: Fay, Proschan and Brittain, Combining
    one-sample confidence procedures for inference in the two-sample case, Biometrics 71, 2015.
    """
    tail = (1 - confidence) / 2
    low, high = _bound_below(first, second, tail), -_bound_below(second, first, tail)
    return round(low, DIGITS), round(high, DIGITS)


def _bound_below(first: tuple[int, int], second: tuple[int, int], tail: float) -> float:
    """Return the lower end: a quantile of a low Beta variable minus a high one.

    The quantiles of the two at ``tail`` are the exact ends of the two rates.
    """
    (successes, trials), (others, of) = first, second
    if not successes:
        return -bound_rate(others, of, 1 - 2 * tail)[1]
    high = scipy.special.betaincinv(others + 1, of - others, _CHANCES) if others < of else 1.0

    def excess(low: float) -> float:
        ends = np.clip(low + high, 0, 1)
        chances = scipy.special.betainc(successes, trials - successes + 1, ends)
        return float(np.sum(_WEIGHTS * chances)) - tail

    return float(scipy.optimize.brentq(excess, -1.0, 1.0, xtol=1e-9))


def share_level(confidence: float, tests: int) -> float:
    """Return the confidence per test at which all tests hold together with ``confidence``."""
    return 1 - (1 - confidence) / tests  # Bonferroni
