"""Powers, hyperbolic functions and the length of a vector."""

import math

from evoros.base.compilable import compilable
from evoros.base.elementary import pairs, tables
from evoros.base.elementary.exponential import exp_of_pair, exp_pair, expm1_pair, log_pair

_LARGE = 40.0
_TINY = 1e-9


@compilable
def power(x: float, y: float) -> float:
    """Return x to the power of y as C's ``pow`` does; NaN for a root of a negative number."""
    if y == 0.0 or x == 1.0:
        return 1.0
    if x != x or y != y:
        return math.nan
    size = abs(x)
    huge = abs(y) >= 9007199254740992.0  # 2**53: all these are even
    whole = huge or y == math.floor(y)
    odd = whole and not huge and (int(y) & 1) == 1
    negative = odd and math.copysign(1.0, x) < 0.0
    if x < 0.0 and not whole and size < math.inf:
        return math.nan
    value = _positive_power(size, y)
    return -value if negative else value


@compilable
def _positive_power(x: float, y: float) -> float:
    """Return x**y for x from 0 to infinity and any y but 0."""
    if x == 1.0:
        return 1.0
    if x == 0.0 or x == math.inf:
        return 0.0 if (x == 0.0) == (y > 0.0) else math.inf
    if abs(y) > 1e20:
        return 0.0 if (x < 1.0) == (y > 0.0) else math.inf
    high, low = log_pair(x)
    product, error = pairs.multiply(high, y)
    product, error = pairs.add_smaller(product, error + low * y)
    return exp_of_pair(product, error)


@compilable
def _half_exp(x: float) -> float:
    """Return e**x / 2, also where e**x would be infinite."""
    high, low = pairs.add(x, -tables.LN2_53_HIGH)
    return exp_of_pair(high, low - tables.LN2_53_LOW)


@compilable
def sinh(x: float) -> float:
    """Return the hyperbolic sine."""
    size = abs(x)
    if not size < _LARGE:
        return math.copysign(_half_exp(size), x)
    if size < _TINY:
        return x
    t, t_low = expm1_pair(size)
    d, d_low = pairs.add(t, 1.0)
    q, q_low = pairs.divide(t, t_low, d, d_low + t_low)
    high, low = pairs.add(t, q)
    return math.copysign(0.5 * (high + (low + (t_low + q_low))), x)


@compilable
def cosh(x: float) -> float:
    """Return the hyperbolic cosine."""
    size = abs(x)
    if not size < _LARGE:
        return _half_exp(size)
    high, low = exp_pair(size)
    q, q_low = pairs.divide(1.0, 0.0, high, low)
    high, error = pairs.add(high, q)
    return 0.5 * (high + (error + (low + q_low)))


@compilable
def tanh(x: float) -> float:
    """Return the hyperbolic tangent."""
    size = abs(x)
    if size < _TINY or x != x:
        return x
    if size > _LARGE:
        return math.copysign(1.0, x)
    t, t_low = expm1_pair(2.0 * size)
    d, d_low = pairs.add(t, 2.0)
    high, low = pairs.divide(t, t_low, d, d_low + t_low)
    return math.copysign(high + low, x)


@compilable
def hypot(x: float, y: float) -> float:
    """Return the length of the vector (x, y)."""
    a, b = abs(x), abs(y)
    if a == math.inf or b == math.inf:
        return math.inf
    if a < b:
        a, b = b, a
    if a != a or b != b:
        return math.nan
    if b < a * 2.0**-60:
        return a
    if a == 0.0:
        return 0.0
    scale = 1.0
    if a > 1e140:
        scale = 2.0**600
    elif b < 1e-140:
        scale = 2.0**-700
    a /= scale
    b /= scale
    root = math.sqrt(a * a + b * b)
    square, error = pairs.multiply(root, root)
    aa, aa_low = pairs.multiply(a, a)
    bb, bb_low = pairs.multiply(b, b)
    over = ((square - aa) - bb) + (error - aa_low - bb_low)
    return (root - over / (2.0 * root)) * scale
