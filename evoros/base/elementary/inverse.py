"""Inverse trigonometric functions, based on the arctangent, and the length of a vector.

An angle above pi/8 is first reduced by pi/4 or pi/2. For the remaining tangent r and z = r**2,
atan(r) = r + r z A(z). A is a Chebyshev approximation by ``mpmath.chebyfit`` on 0 <= z <= 0.1716,
with eleven coefficients and an error below 2**-57.
"""

import math

from evoros.base.compilable import compilable
from evoros.base.elementary.arithmetic import polynomial
from evoros.base.elementary.trigonometry import EIGHTH, HALF_PI, HALF_PI_REST

ARCTANGENT = (
    -0.3333333333333333,
    0.19999999999995513,
    -0.1428571428466518,
    0.11111111015146714,
    -0.0909090457366906,
    0.07692183087342026,
    -0.06664509989818045,
    0.058581362519061465,
    -0.05085383488842831,
    0.03922974453661223,
    -0.019174543572021332,
)
_EVEN, _ODD = ARCTANGENT[::2], ARCTANGENT[1::2]
_TAN_22, _TAN_67 = 0.41421356237309503, 2.414213562373095  # tangents of pi/8 and 3 pi/8
_HUGE = 1e300


@compilable
def _angle(y: float, x: float) -> float:
    """Return the angle of a point (x, y) with x >= 0, y >= 0 and a finite sum."""
    if y > _TAN_67 * x:
        base, rest, r = HALF_PI, HALF_PI_REST, -x / y
    elif y > _TAN_22 * x:
        base, rest, r = EIGHTH, 0.5 * HALF_PI_REST, (y - x) / (y + x)
    else:
        base, rest, r = 0.0, 0.0, y / x
    z = r * r
    square = z * z
    series = polynomial(square, _EVEN) + z * polynomial(square, _ODD)
    return base + (r + (rest + r * z * series))


@compilable
def atan2(y: float, x: float) -> float:
    """Return the angle [rad] of a point (x, y), from -pi to pi."""
    if x != x or y != y:
        return math.nan
    ay, ax = abs(y), abs(x)
    if ay == math.inf or ax == math.inf:
        ay, ax = 1.0 if ay == math.inf else 0.0, 1.0 if ax == math.inf else 0.0
    elif ay > _HUGE or ax > _HUGE:
        ay, ax = ay * 2.0**-9, ax * 2.0**-9
    angle = 0.0 if ay == 0.0 else _angle(ay, ax)
    if math.copysign(1.0, x) < 0.0:
        angle = 2.0 * HALF_PI - (angle - 2.0 * HALF_PI_REST)
    return math.copysign(angle, y)


@compilable
def atan(x: float) -> float:
    """Return the arctangent [rad]."""
    return math.copysign(_angle(abs(x), 1.0), x)


@compilable
def asin(x: float) -> float:
    """Return the arcsine [rad]; NaN outside -1 to 1."""
    size = abs(x)
    if not size <= 1.0:
        return math.nan
    return math.copysign(_angle(size, math.sqrt((1.0 - size) * (1.0 + size))), x)


@compilable
def acos(x: float) -> float:
    """Return the arccosine [rad]; NaN outside -1 to 1."""
    if not abs(x) <= 1.0:
        return math.nan
    return atan2(math.sqrt((1.0 - x) * (1.0 + x)), x)


@compilable
def hypot(x: float, y: float) -> float:
    """Return the length of the vector (x, y)."""
    a, b = abs(x), abs(y)
    if a == math.inf or b == math.inf:
        return math.inf
    scale = 1.0
    if a > 1e140 or b > 1e140:
        scale = 2.0**600
    elif a < 1e-140 and b < 1e-140:
        scale = 2.0**-600
    a /= scale
    b /= scale
    return math.sqrt(a * a + b * b) * scale
