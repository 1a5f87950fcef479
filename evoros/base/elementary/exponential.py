"""Exponential functions and logarithms: table values, and short series between them."""

import math

from evoros.base.compilable import compilable
from evoros.base.elementary import pairs, tables

_GRID = 6755399441055744.0
"""1.5 * 2**52: a number plus this, minus this, is rounded to an integer."""
_FINE = _GRID / 1073741824.0
"""The same for multiples of 2**-30."""
_HIGHEST, _LOWEST = 709.782712893384, -745.1332191019412
"""Beyond these, exp is infinite or 0."""
_E2, _E3, _E4, _E5, _E6 = 0.5, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0
_SQRT_HALF = 0.7071067811865476
_SHORT = 0.25
"""[-_SHORT, _SHORT]: where expm1 is its series."""
_NEAR = 2.0**-8
"""(-_NEAR, _NEAR): where log1p needs no table."""


@compilable
def _exp_pair(x: float, low: float) -> tuple[float, float, int]:
    """Return exp of a pair as a pair from 1 to 2, and the power of 2 to multiply it with."""
    steps = (x * tables.EXP_STEPS + _GRID) - _GRID
    count = int(steps)
    r = ((x - steps * tables.LN2_128_1) - steps * tables.LN2_128_2) + low
    high = float(tables.EXP_HIGH[count & 127])
    growth = r + r * r * (_E2 + r * (_E3 + r * (_E4 + r * (_E5 + r * _E6))))
    return high, float(tables.EXP_LOW[count & 127]) + high * growth, count >> 7


@compilable
def _scale(x: float, exponent: int) -> float:
    """Return x * 2**exponent for x near 1, with exponents from -1080 to 1024."""
    if exponent < -1020:
        return x * float(tables.POWERS[exponent + 1022 + 200]) * 2.0**-200
    if exponent > 1022:
        return x * float(tables.POWERS[exponent + 1022 - 1]) * 2.0
    return x * float(tables.POWERS[exponent + 1022])


@compilable
def exp_of_pair(x: float, low: float) -> float:
    """Return exp of the sum of a pair."""
    if x > _HIGHEST:
        return math.inf
    if x < _LOWEST:
        return 0.0
    if x != x:
        return x
    high, rest, exponent = _exp_pair(x, low)
    return _scale(high + rest, exponent)


@compilable
def exp(x: float) -> float:
    """Return e**x."""
    return exp_of_pair(x, 0.0)


@compilable
def expm1(x: float) -> float:
    """Return e**x - 1, with all digits for small x."""
    if abs(x) < 1e-17 or x != x:
        return x
    if x > 700.0:
        return exp(x)
    if x < -50.0:
        return -1.0
    high, low = expm1_pair(x)
    return high + low


@compilable
def expm1_pair(x: float) -> tuple[float, float]:
    """Return e**x - 1 as a pair, for x from -50 to 700."""
    if abs(x) <= _SHORT:
        square, error = pairs.multiply(x, 0.5 * x)
        high, low = pairs.add_smaller(x, square)
        series = 0.0
        for i in range(14, 2, -1):
            series = (series + 1.0) * x / i
        return pairs.add_smaller(high, low + error + 0.5 * x * x * series)
    high, low = exp_pair(x)
    high, error = pairs.add(high, -1.0)
    return pairs.add_smaller(high, error + low)


@compilable
def exp_pair(x: float) -> tuple[float, float]:
    """Return e**x as a pair, for x from -700 to 700."""
    high, low, exponent = _exp_pair(x, 0.0)
    scale = float(tables.POWERS[exponent + 1022])
    return pairs.add_smaller(high * scale, low * scale)


@compilable
def log_pair(x: float) -> tuple[float, float]:
    """Return the logarithm of x as a pair, for x > 0."""
    m, exponent = math.frexp(x)
    if m < _SQRT_HALF:
        m *= 2.0
        exponent -= 1
    i = int(128.0 * m + 0.5) - tables.LOG_FIRST
    inverse = float(tables.LOG_INVERSE[i])
    # Both halves of m times the inverse, of 10 bits, are exact.
    m1 = (m + _FINE) - _FINE
    r, r_low = pairs.add(m1 * inverse - 1.0, (m - m1) * inverse)
    high = exponent * tables.LN2_HIGH + float(tables.LOG_HIGH[i])
    low = exponent * tables.LN2_LOW + float(tables.LOG_LOW[i])
    return _add_log(high, low, r, r_low)


@compilable
def _add_log(high: float, low: float, r: float, r_low: float) -> tuple[float, float]:
    """Return the sum of two pairs, of the second the logarithm of 1 plus it, as a pair."""
    high, error = pairs.add(high, r)
    square, square_low = pairs.multiply(r, -0.5 * r)
    high, more = pairs.add(high, square)
    series = 0.0
    for i in range(9, 2, -1):
        series = 1.0 / i - r * series
    low += r_low - r * r_low + (square_low + r * r * r * series)
    return pairs.add_smaller(high, error + more + low)


@compilable
def log(x: float) -> float:
    """Return the natural logarithm; -inf at 0, and NaN below."""
    if 0.0 < x < math.inf:
        high, low = log_pair(x)
        return high + low
    return _log_of_none(x)


@compilable
def _log_of_none(x: float) -> float:
    """Return the logarithm of what has none, and of infinity."""
    if x == 0.0:
        return -math.inf
    return math.nan if x < 0.0 else x


@compilable
def log1p(x: float) -> float:
    """Return log(1 + x), with all digits for small x; -inf at -1, and NaN below."""
    if abs(x) < _NEAR:
        if abs(x) < 1e-17:
            return x
        high, low = _add_log(0.0, 0.0, x, 0.0)
        return high + low
    total, low = pairs.add(1.0, x)
    if 0.0 < total < 1e300:
        high, rest = log_pair(total)
        return high + (rest + low / total)
    return log(total)


@compilable
def _log_times(x: float, factor: float, factor_low: float) -> float:
    if not 0.0 < x < math.inf:
        return _log_of_none(x)
    high, low = log_pair(x)
    product, error = pairs.multiply(high, factor)
    return product + (error + (high * factor_low + low * factor))


@compilable
def log2(x: float) -> float:
    """Return the logarithm to the base 2; -inf at 0, and NaN below."""
    return _log_times(x, tables.LOG2E_HIGH, tables.LOG2E_LOW)


@compilable
def log10(x: float) -> float:
    """Return the logarithm to the base 10; -inf at 0, and NaN below."""
    return _log_times(x, tables.LOG10E_HIGH, tables.LOG10E_LOW)
