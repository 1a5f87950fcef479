"""Logarithms, and powers, which require a logarithm of twice the precision.

x is m 2**k with m from sqrt(1/2) to sqrt(2). With s = (m - 1)/(m + 1) and z = s**2, log(m) = 2 s +
s z (2/3 + z L(z)). L is a Chebyshev approximation by ``mpmath.chebyfit`` on 0 <= z <= 0.02944, with
eight coefficients and an error below 2**-69.
"""

import math

from evoros.base.compilable import compilable, inlined
from evoros.base.elementary.arithmetic import add, multiply, polynomial
from evoros.base.elementary.exponential import LN2_1, LN2_2, LOG2_E, exp_of_sum

LOGARITHM = (
    0.4,
    0.28571428571429364,
    0.22222222221655907,
    0.181818183353876,
    0.15384594963074136,
    0.13334804663624336,
    0.11706237148816372,
    0.11723170160799075,
)
LOG10_2_1, LOG10_2_2 = 0.30102999566395283, 2.8363394551044964e-14
"""Two parts of log10(2); the first has 42 bits."""
LOG10_E = 0.4342944819032518
THIRDS, THIRDS_REST = 2.0 / 3.0, 3.700743415417188e-17
_SQRT_HALF = 0.7071067811865476


@inlined
def _divide(x: float) -> tuple[float, int]:
    """Return m - 1 and k for x = m 2**k."""
    m, k = math.frexp(x)
    return (m + m - 1.0, k - 1) if m < _SQRT_HALF else (m - 1.0, k)


@inlined
def _log_near_1(f: float, k: float, rest: float) -> float:
    """Return log(1 + f) + k ln 2 + rest."""
    s = f / (2.0 + f)
    z = s * s
    half = 0.5 * f * f
    series = z * (THIRDS + z * polynomial(z, LOGARITHM))
    return k * LN2_1 - ((half - (s * (half + series) + (k * LN2_2 + rest))) - f)


@compilable
def _log_of_none(x: float) -> float:
    """Return log(x) for x that is not both positive and finite."""
    if x == 0.0:
        return -math.inf
    return math.nan if x < 0.0 else x


@compilable
def log(x: float) -> float:
    """Return the natural logarithm; -inf at 0, NaN below."""
    if not 0.0 < x < math.inf:
        return _log_of_none(x)
    f, k = _divide(x)
    return _log_near_1(f, float(k), 0.0)


@compilable
def log1p(x: float) -> float:
    """Return log(1 + x), with full precision for small x; -inf at -1, NaN below."""
    if x == 0.0:
        return x
    if -0.25 < x < 0.4:
        return _log_near_1(x, 0.0, 0.0)
    total, rest = add(1.0, x)
    if not 0.0 < total < math.inf:
        return _log_of_none(total)
    f, k = _divide(total)
    return _log_near_1(f, float(k), rest / total)


@compilable
def log2(x: float) -> float:
    """Return the base-2 logarithm; -inf at 0, NaN below."""
    if not 0.0 < x < math.inf:
        return _log_of_none(x)
    f, k = _divide(x)
    return float(k) + LOG2_E * _log_near_1(f, 0.0, 0.0)


@compilable
def log10(x: float) -> float:
    """Return the base-10 logarithm; -inf at 0, NaN below."""
    if not 0.0 < x < math.inf:
        return _log_of_none(x)
    f, k = _divide(x)
    return float(k) * LOG10_2_1 + (float(k) * LOG10_2_2 + LOG10_E * _log_near_1(f, 0.0, 0.0))


@inlined
def _log_pair(x: float) -> tuple[float, float]:
    """Return the logarithm of x and its rounding error, together accurate to 64 bits."""
    f, k = _divide(x)
    m, m_rest = add(f, 2.0)
    s = f / m
    back, error = multiply(s, m)
    s_rest = (((f - back) - error) - s * m_rest) / m
    z, z_rest = multiply(s, s)
    z_rest += 2.0 * s * s_rest
    cube, cube_rest = multiply(s, z)
    cube_rest += s * z_rest + s_rest * z
    series, series_rest = add(THIRDS, z * polynomial(z, LOGARITHM))
    third, third_rest = multiply(cube, series)
    third_rest += cube * (series_rest + THIRDS_REST) + cube_rest * series
    high, low = add(2.0 * s, third)
    low += third_rest + 2.0 * s_rest
    high, error = add(float(k) * LN2_1, high)
    return high, error + (low + float(k) * LN2_2)


@compilable
def power(x: float, y: float) -> float:
    """Return x**y as C's ``pow`` does; NaN for a fractional power of a negative number."""
    if y == 0.0 or x == 1.0:
        return 1.0
    if x != x or y != y:
        return math.nan
    huge = abs(y) >= 2.0**53  # all such doubles are even integers
    whole = huge or y == math.floor(y)
    odd = whole and not huge and (int(y) & 1) == 1
    if -math.inf < x < 0.0 and not whole:
        return math.nan
    value = _positive_power(abs(x), y)
    return math.copysign(value, x) if odd else value


@compilable
def _positive_power(x: float, y: float) -> float:
    """Return x**y for x from 0 to infinity and nonzero y."""
    if x == 1.0:
        return 1.0
    if x == 0.0 or x == math.inf or abs(y) > 1e20:
        return 0.0 if (x < 1.0) == (y > 0.0) else math.inf
    high, low = _log_pair(x)
    product, error = multiply(high, y)
    return exp_of_sum(product, error + low * y)
