"""Sine, cosine and tangent: table values of multiples of 1/32, and short series between them."""

import math

from evoros.base.compilable import compilable, inlined
from evoros.base.elementary import pairs, tables
from evoros.base.elementary.reduction import reduce_angle

_GRID = 6755399441055744.0
"""1.5 * 2**52: a number plus this, minus this, is rounded to an integer."""
_FINE = _GRID / 549755813888.0
"""The same for multiples of 2**-39."""
_SMALL = 0.0625

# Coefficients of x**2, x**4 ... in sin(x)/x, and in cos(x).
_S1, _S2, _S3, _S4, _S5 = -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362880.0, -1.0 / 39916800.0
_C1, _C2, _C3, _C4, _C5 = -0.5, 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40320.0, -1.0 / 3628800.0


@inlined
def _short_series(x: float) -> tuple[float, float]:
    """Return sin(x) - x and cos(x) - 1 for small x."""
    z = x * x
    return (
        x * z * (_S1 + z * (_S2 + z * (_S3 + z * (_S4 + z * _S5)))),
        z * (_C1 + z * (_C2 + z * (_C3 + z * (_C4 + z * _C5)))),
    )


@inlined
def sin_cos_pairs(y: float, low: float) -> tuple[float, float, float, float]:
    """Return the sine and the cosine, as pairs, of the pair (y, low) from 0 to 0.8."""
    if y < _SMALL:
        sin_low, cos_low = _short_series(y)
        return y, low + sin_low, 1.0, cos_low - y * low
    steps = (32.0 * y + _GRID) - _GRID
    i = int(steps)
    r = y - steps * 0.03125
    r1 = (r + _FINE) - _FINE
    r2 = r - r1
    z = r * r
    s = float(tables.SIN_HIGH[i])
    c = float(tables.COS_HIGH[i])
    s1 = float(tables.SIN_1[i])
    c1 = float(tables.COS_1[i])
    odd = r * z * (_S1 + z * (_S2 + z * _S3))
    even = z * (_C1 + z * (_C2 + z * _C3))
    product = c1 * r1  # exact, as the next one
    sin = s + product
    sin_low = product - (sin - s)
    across = c1 * r2 + float(tables.COS_2[i]) * r + (c - s * r) * low
    sin_low += float(tables.SIN_LOW[i]) + across + (c * odd + s * even)
    product = s1 * r1
    cos = c - product
    cos_low = (c - cos) - product
    across = s1 * r2 + float(tables.SIN_2[i]) * r + (s + c * r) * low
    cos_low += float(tables.COS_LOW[i]) - across + (c * even - s * odd)
    return sin, sin_low, cos, cos_low


@inlined
def sin_cos(x: float) -> tuple[float, float]:
    """Return the sine and the cosine of x [rad], with the bits of ``sin`` and ``cos``."""
    size = abs(x)
    if size < _SMALL:
        sin_low, cos_low = _short_series(x)
        return x + sin_low if x != 0.0 else x, 1.0 + cos_low
    if not size < math.inf:
        return math.nan, math.nan
    quarter, y, low = reduce_angle(x)
    negative = y < 0.0
    if negative:
        y = -y
        low = -low
    s, s_low, c, c_low = sin_cos_pairs(y, low)
    sin = s + s_low
    cos = c + c_low
    if negative:
        sin = -sin
    if quarter == 0:
        return sin, cos
    if quarter == 1:
        return cos, -sin
    if quarter == 2:
        return -sin, -cos
    return -cos, sin


@inlined
def sin(x: float) -> float:
    """Return the sine of x [rad]."""
    return sin_cos(x)[0]


@compilable
def cos(x: float) -> float:
    """Return the cosine of x [rad]."""
    return sin_cos(x)[1]


@inlined
def tan(x: float) -> float:
    """Return the tangent of x [rad]."""
    if abs(x) < 1e-9:
        return x
    if not abs(x) < math.inf:
        return math.nan
    quarter, y, low = reduce_angle(x)
    negative = y < 0.0
    if negative:
        y = -y
        low = -low
    s, s_low, c, c_low = sin_cos_pairs(y, low)
    s, s_low = pairs.add_smaller(s, s_low)
    c, c_low = pairs.add_smaller(c, c_low)
    if quarter == 1 or quarter == 3:
        high, rest = pairs.divide(c, c_low, s, s_low)
        negative = not negative
    else:
        high, rest = pairs.divide(s, s_low, c, c_low)
    value = high + rest
    return -value if negative else value
