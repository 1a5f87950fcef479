"""Sine, cosine and tangent of an angle: reduced to an eighth of a turn, there a polynomial.

With z = x**2, sin(x) = x + x z S(z) and cos(x) = 1 - z/2 + z**2 C(z). S and C are Chebyshev's
approximations: ``mpmath.chebyfit`` of these equations on 0 <= z <= 0.6169, with six coefficients
each. Their errors are below 2**-56.

The tangent is Lambert's continued fraction x/(1 - z/(3 - z/(5 - ...))) down to 17, as x + x z N/D.
"""

import math

from evoros.base.compilable import compilable, inlined
from evoros.base.elementary.arithmetic import polynomial
from evoros.base.elementary.reduction import reduce_angle

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
_TINY = 2.0**-27
"""Below this, x is the sine and the tangent, and 1 the cosine."""


@inlined
def sin_cos(x: float) -> tuple[float, float]:
    """Return the sine and the cosine of x [rad]."""
    if abs(x) < _TINY:
        return x, 1.0
    if not abs(x) < math.inf:
        return math.nan, math.nan
    quarter, y, rest = reduce_angle(x)
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
    quarter, y, rest = reduce_angle(x)
    z = y * y
    fraction = polynomial(z, _TANGENT_N) / polynomial(z, _TANGENT_D)
    value = y + (rest * (1.0 + z) + y * z * fraction)
    return -1.0 / value if quarter & 1 else value
