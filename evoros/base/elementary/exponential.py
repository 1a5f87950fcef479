"""Exponential and hyperbolic functions.

x is k ln 2 plus a remainder r of at most ln(2)/2, so exp(x) is exp(r) 2**k. With z = r**2, exp(r)
= 1 + 2r/(R - r), where R = r coth(r/2) = 2 + z E(z). E is a Chebyshev approximation by
``mpmath.chebyfit`` on 0 <= z <= 0.1202, with five coefficients and an error below 2**-57.
"""

import math

from evoros.base.compilable import compilable, inlined
from evoros.base.elementary.arithmetic import nearest, polynomial, scale

LN2_1, LN2_2 = 0.6931471805598903, 5.497923018708371e-14
"""Two parts of ln 2; the first has 42 bits, so its products with 11-bit numbers are exact."""
LOG2_E = 1.4426950408889634
EXPONENTIAL = (
    0.1666666666666666,
    -0.0027777777777563957,
    6.613756471400626e-05,
    -1.653405968872539e-06,
    4.143749871385379e-08,
)
_HIGHEST, _LOWEST = 709.782712893384, -745.1332191019412  # limits: exp is infinite above, 0 below
_LARGE, _HUGE = 50.0, 700.0  # limits above which 1 is negligible to e**x, and e**x may overflow


@inlined
def _reduced_expm1(x: float, rest: float, k: float) -> float:
    """Return e**r - 1 for r = x + rest - k ln 2."""
    high = x - k * LN2_1
    low = rest - k * LN2_2
    r = high + low
    z = r * r
    c = r - z * polynomial(z, EXPONENTIAL)
    return high + (low + r * c / (2.0 - c))


@compilable
def exp_of_sum(x: float, rest: float) -> float:
    """Return exp(x + rest) for a rest below one unit in the last place of x."""
    if x > _HIGHEST:
        return math.inf
    if x < _LOWEST:
        return 0.0
    if x != x:
        return x
    k = nearest(x * LOG2_E)
    return scale(1.0 + _reduced_expm1(x, rest, k), int(k))


@compilable
def exp(x: float) -> float:
    """Return e**x."""
    return exp_of_sum(x, 0.0)


@compilable
def expm1(x: float) -> float:
    """Return e**x - 1, with full precision for small x."""
    if x == 0.0:
        return x
    if not abs(x) < _LARGE:
        return exp(x) - 1.0
    k = nearest(x * LOG2_E)
    power = scale(1.0, int(k))
    return (power - 1.0) + power * _reduced_expm1(x, 0.0, k)


@compilable
def sinh(x: float) -> float:
    """Return the hyperbolic sine."""
    size = abs(x)
    if size > _HUGE:
        root = exp(0.5 * size)
        return math.copysign(0.5 * root * root, x)
    t = expm1(size)
    return math.copysign(0.5 * (t + t / (t + 1.0)), x)


@compilable
def cosh(x: float) -> float:
    """Return the hyperbolic cosine."""
    size = abs(x)
    if size > _HUGE:
        root = exp(0.5 * size)
        return 0.5 * root * root
    t = exp(size)
    return 0.5 * t + 0.5 / t


@compilable
def tanh(x: float) -> float:
    """Return the hyperbolic tangent."""
    size = abs(x)
    if size > _LARGE:
        return math.copysign(1.0, x)
    t = expm1(2.0 * size)
    return math.copysign(t / (t + 2.0), x)
