"""Brent's method; the results equal those from ``scipy.optimize.brentq``, which is slow to import.

Source: Brent, Algorithms for Minimization Without Derivatives, 1973, chapter 4.
"""

import math
from collections.abc import Callable

RELATIVE = 4 * 2.0**-52  # relative tolerance


def find_root(function: Callable[[float], float], low: float, high: float, xtol: float) -> float:
    """Return a root of a function whose signs differ at ``low`` and ``high``, within ``xtol``."""
    old, best = low, high
    at_old, at_best = function(old), function(best)
    if at_old == 0:
        return old
    while at_best != 0:
        if at_old != 0 and (at_old < 0) != (at_best < 0):  # the root is between best and other
            other, at_other, last, step = old, at_old, best - old, best - old
        if abs(at_other) < abs(at_best):
            old, best, other = best, other, best
            at_old, at_best, at_other = at_best, at_other, at_best
        tolerance, half = (xtol + RELATIVE * abs(best)) / 2, (other - best) / 2
        if abs(half) < tolerance:
            break
        guess = math.inf
        if abs(last) > tolerance and abs(at_best) < abs(at_old):
            guess = _interpolate((old, at_old), (best, at_best), (other, at_other))
        useful = 2 * abs(guess) < min(abs(last), 3 * abs(half) - tolerance)
        last, step = (step, guess) if useful else (half, half)
        old, at_old = best, at_best
        best += step if abs(step) > tolerance else tolerance if half > 0 else -tolerance
        at_best = function(best)
    return best


Point = tuple[float, float]


def _interpolate(old: Point, best: Point, other: Point) -> float:
    """Return the step from ``best`` to a root by inverse quadratic or linear interpolation."""
    (x, y), (x1, y1), (x2, y2) = old, best, other
    if x == x2:
        return -y1 * (x1 - x) / (y1 - y)
    one, two = (y - y1) / (x - x1), (y2 - y1) / (x2 - x1)
    return -y1 * (y2 * two - y * one) / (two * one * (y2 - y))
