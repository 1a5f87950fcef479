"""Inverses of the trigonometric functions, by the arctangent of a fraction of two pairs."""

import math

from evoros.base.compilable import compilable
from evoros.base.elementary import pairs, tables

_GRID = 6755399441055744.0
"""1.5 * 2**52: a number plus this, minus this, is rounded to an integer."""
_TINY = 2.0**-30
"""Below this, the arctangent of a number is the number."""
_A1, _A2, _A3, _A4, _A5 = -1.0 / 3.0, 0.2, -1.0 / 7.0, 1.0 / 9.0, -1.0 / 11.0


@compilable
def _atan_pair(n: float, n_low: float, d: float, d_low: float) -> tuple[float, float]:
    """Return the arctangent of the fraction n/d of pairs, from 0 to 1, as a pair."""
    quotient = n / d
    if quotient < _TINY:
        return quotient, 0.0
    steps = (32.0 * quotient + _GRID) - _GRID
    a = steps * 0.03125
    product, error = pairs.multiply(a, d)
    over, over_low = pairs.add(n, -product)
    over_low += (n_low - error) - a * d_low
    product, error = pairs.multiply(a, n)
    under, under_low = pairs.add(d, product)
    under_low += (d_low + error) + a * n_low
    t, t_low = pairs.divide(over, over_low, under, under_low)
    z = t * t
    i = int(steps)
    angle, rest = pairs.add_smaller(float(tables.ATAN_HIGH[i]), t)
    series = t * z * (_A1 + z * (_A2 + z * (_A3 + z * (_A4 + z * _A5))))
    return angle, rest + (float(tables.ATAN_LOW[i]) + t_low + series)


@compilable
def _angle(y: float, y_low: float, x: float, x_low: float) -> float:
    """Return the angle of the point (x, y) of pairs, neither both 0 nor both infinite."""
    ay, ax = abs(y), abs(x)
    ay_low = y_low if y > 0.0 else -y_low
    ax_low = x_low if x > 0.0 else -x_low
    if ay > ax:
        angle, low = _atan_pair(ax, ax_low, ay, ay_low)
        angle, error = pairs.add_smaller(tables.HALF_PI_HIGH, -angle)
        low = (tables.HALF_PI_LOW - low) + error
    else:
        angle, low = _atan_pair(ay, ay_low, ax, ax_low)
    if x < 0.0:
        angle, error = pairs.add_smaller(tables.PI_HIGH, -angle)
        low = (tables.PI_LOW - low) + error
    return math.copysign(angle + low, y)


@compilable
def atan2(y: float, x: float) -> float:
    """Return the angle [rad] of the point (x, y), from -pi to pi."""
    if x != x or y != y:
        return math.nan
    if y == 0.0:
        return math.copysign(0.0 if math.copysign(1.0, x) > 0.0 else tables.PI_HIGH, y)
    ay, ax = abs(y), abs(x)
    if ay == math.inf or ax == math.inf:
        y, x = _corner(y, ay), _corner(x, ax)
    elif ay > 1e280 or ax > 1e280:
        if x > 0.0 and ay < ax * _TINY:
            return y / x
        y *= 2.0**-200
        x *= 2.0**-200
    elif ay < 1e-200 or ax < 1e-200:
        if x > 0.0 and ay < ax * _TINY:
            return y / x
        y *= 2.0**200
        x *= 2.0**200
    return _angle(y, 0.0, x, 0.0)


@compilable
def _corner(value: float, size: float) -> float:
    """Return 1 with the sign of an infinite value, and 0 for others."""
    return math.copysign(1.0 if size == math.inf else 0.0, value)


@compilable
def atan(x: float) -> float:
    """Return the arctangent [rad]."""
    return atan2(x, 1.0)


@compilable
def _leg(x: float) -> tuple[float, float]:
    """Return the square root of 1 - x**2 as a pair."""
    square, error = pairs.multiply(x, x)
    high, low = pairs.add(1.0, -square)
    low -= error
    high, low = pairs.add_smaller(high, low)
    root = math.sqrt(high)
    square, error = pairs.multiply(root, root)
    return root, (((high - square) - error) + low) / (2.0 * root)


@compilable
def asin(x: float) -> float:
    """Return the arcsine [rad]; NaN outside -1 to 1."""
    size = abs(x)
    if size < _TINY:
        return x
    if size < 1.0:
        leg, leg_low = _leg(x)
        return _angle(x, 0.0, leg, leg_low)
    return math.copysign(tables.HALF_PI_HIGH, x) if size == 1.0 else math.nan


@compilable
def acos(x: float) -> float:
    """Return the arccosine [rad]; NaN outside -1 to 1."""
    size = abs(x)
    if size < 1.0:
        leg, leg_low = _leg(x)
        return _angle(leg, leg_low, x, 0.0)
    if size == 1.0:
        return 0.0 if x > 0.0 else tables.PI_HIGH
    return math.nan
