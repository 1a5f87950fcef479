"""Sine, cosine and tangent, by polynomials after reduction to an eighth of a turn.

With z = x**2, sin(x) = x + x z S(z) and cos(x) = 1 - z/2 + z**2 C(z). S and C are Chebyshev
approximations by ``mpmath.chebyfit`` on 0 <= z <= 0.6169, with six coefficients each and errors
below 2**-56. The tangent is Lambert's continued fraction x/(1 - z/(3 - z/(5 - ...))) down to 17,
as x + x z N/D.

Up to a million radians, multiples of pi/2 in three parts are subtracted (Cody and Waite, *Software
Manual for the Elementary Functions*, 1980). Larger angles, and angles too close to a quarter turn
for three parts, are multiplied by enough bits of 2/pi for any double (Payne and Hanek, *Radian
reduction for trigonometric functions*, 1983). The reduction of every finite angle is thus
accurate.
"""

import math

import numpy as np

from evoros.base.arrays import Array
from evoros.base.compilable import compilable, inlined
from evoros.base.elementary.arithmetic import add, multiply, nearest, polynomial, split

EIGHTH = 0.7853981633974483
_TWO_OVER_PI = 0.6366197723675814
HALF_PI, HALF_PI_REST = 1.5707963267948966, 6.123233995736766e-17
# The parts add up to pi/2; the first two have 33 bits, so that 20-bit multiples are exact.
PART_1, PART_2, PART_3 = 1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21

_MANY = 1e6  # [rad], below which the number of quarter turns has at most 20 bits
_CLOSE = 2.0**-60  # [rad] per quarter turn, minimum remainder for which three parts suffice
_ALL_WHOLE = 2.0**52  # larger products are whole turns, with at most 50 significant bits
_SCALE = 200  # power of 2 moved from the angle to 2/pi, to prevent under- and overflow
TWO_OVER_PI_BITS = (
    "a2f9836e4e441529fc2757d1f534ddc0db6295993c439041fe5163abdebbc561b7246e3a"
    "424dd2e006492eea09d1921cfe1deb1cb129a73ee88235f52ebb4484e99c7026b45f7e41"
    "3991d639835339f49c845f8bbdf9283b1ff897ffde05980fef2f118b5a0a6d1f6d367ecf"
    "27cb09b74f463f669e5fea2d7527bac7ebe5f17b3d0739f78a5292ea6bfb5fb11f8d5d08"
    "56033046fc7b"
)
_PARTS: Array = np.array(
    [
        math.ldexp(int(TWO_OVER_PI_BITS[i : i + 6], 16), _SCALE - 24 - 4 * i)
        for i in range(0, len(TWO_OVER_PI_BITS), 6)
    ]
)
SINE = (
    -0.16666666666666666,
    0.008333333333330948,
    -0.0001984126983675712,
    2.755731610179909e-06,
    -2.5051131688000297e-08,
    1.5918117983848815e-10,
)
COSINE = (
    0.041666666666666664,
    -0.0013888888888887398,
    2.4801587298764778e-05,
    -2.7557317271258515e-07,
    2.0876146170183976e-09,
    -1.1382625349447592e-11,
)
_TANGENT_N = (11486475.0, -810810.0, 12870.0, -44.0)
_TANGENT_D = (34459425.0, -16216200.0, 945945.0, -13860.0, 45.0)
_TINY = 2.0**-27  # angle below which an angle equals its sine and tangent, and the cosine is 1


@inlined
def sin_cos(x: float) -> tuple[float, float]:
    """Return the sine and the cosine of x [rad]."""
    if abs(x) < _TINY:
        return x, 1.0
    if not abs(x) < math.inf:
        return math.nan, math.nan
    quarter, y, rest = _reduce_angle(x)
    z = y * y
    sin = y + (rest + y * z * polynomial(z, SINE))
    half = 0.5 * z
    cos = 1.0 - half
    cos += ((1.0 - cos) - half) + (z * z * polynomial(z, COSINE) - y * rest)
    if quarter & 1:
        sin, cos = cos, -sin
    if quarter & 2:
        sin, cos = -sin, -cos
    return sin, cos


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
    if abs(x) < _TINY:
        return x
    if not abs(x) < math.inf:
        return math.nan
    quarter, y, rest = _reduce_angle(x)
    z = y * y
    fraction = polynomial(z, _TANGENT_N) / polynomial(z, _TANGENT_D)
    value = y + (rest * (1.0 + z) + y * z * fraction)
    return -1.0 / value if quarter & 1 else value


@inlined
def _reduce_angle(x: float) -> tuple[int, float, float]:
    """Return the quarter turn (0 to 3) nearest to a finite x [rad], the remainder and its error."""
    if abs(x) <= EIGHTH:
        return 0, x, 0.0
    if abs(x) <= _MANY:
        turns = nearest(x * _TWO_OVER_PI)
        high, low = add(x - turns * PART_1, -turns * PART_2)
        if abs(high) > abs(turns) * _CLOSE:
            low -= turns * PART_3
            remainder = high + low
            return int(turns) & 3, remainder, (high - remainder) + low
    return _reduce_long(x)


@compilable
def _reduce_long(x: float) -> tuple[int, float, float]:
    """Return the same as ``_reduce_angle``, for any finite angle."""
    high, middle, low = 0.0, 0.0, 0.0
    halves = split(x * 2.0**-_SCALE)
    for part in _PARTS:
        for half in halves:
            product = half * float(part)  # exact, in quarter turns
            if abs(product) < _ALL_WHOLE:
                high, error = add(high, product - 4.0 * nearest(0.25 * product))
                middle, error = add(middle, error)
                low += error
    turns = nearest(high)
    high, error = add(high - turns, middle)
    remainder, rest = multiply(high, HALF_PI)
    rest += high * HALF_PI_REST + (error + low) * HALF_PI
    return int(turns) & 3, remainder, rest
