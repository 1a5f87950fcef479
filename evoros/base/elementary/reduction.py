"""Reduction of angles to at most an eighth of a turn.

Up to a million radians, pi/2 in three parts is subtracted (Cody and Waite, *Software Manual for the
Elementary Functions*, 1980). Greater angles, and those that are too close to a quarter turn for
three parts, are multiplied by as many bits of 2/pi as a double can need (Payne and Hanek, *Radian
reduction for trigonometric functions*, 1983). So every finite angle is reduced to all its digits.
"""

import math

import numpy as np

from evoros.base.arrays import Array
from evoros.base.compilable import compilable, inlined
from evoros.base.elementary.arithmetic import add, multiply, nearest, split

EIGHTH = 0.7853981633974483
TWO_OVER_PI = 0.6366197723675814
HALF_PI, HALF_PI_REST = 1.5707963267948966, 6.123233995736766e-17
# Their sum is pi/2. The first two have 33 bits, so their products with 20 bits are exact.
PART_1, PART_2, PART_3 = 1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21

_MANY = 1e6
"""[rad]: up to here, the number of quarter turns has at most 20 bits."""
_CLOSE = 2.0**-60
"""[rad]: closer to so many quarter turns, times their number, three parts are not enough."""
_ALL_WHOLE = 2.0**52
"""Products from here on are whole turns, because they have at most 50 significant bits."""
_SCALE = 200
"""The power of 2 by which the angle is made less, and 2/pi more, so that neither under- nor
overflows."""
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


@inlined
def reduce_angle(x: float) -> tuple[int, float, float]:
    """Return the nearest quarter turn (0 to 3) to x [rad], the remainder of x, and its rest.

    The rest is the rounding error of the remainder. The angle must be finite.
    """
    if abs(x) <= EIGHTH:
        return 0, x, 0.0
    if abs(x) <= _MANY:
        turns = nearest(x * TWO_OVER_PI)
        high, low = add(x - turns * PART_1, -turns * PART_2)
        if abs(high) > abs(turns) * _CLOSE:
            low -= turns * PART_3
            remainder = high + low
            return int(turns) & 3, remainder, (high - remainder) + low
    return _reduce_long(x)


@compilable
def _reduce_long(x: float) -> tuple[int, float, float]:
    """Return the result of ``reduce_angle`` for any finite angle."""
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
