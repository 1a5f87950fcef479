"""Reduction of angles to at most an eighth of a turn."""

import math

from evoros.base.compilable import compilable, inlined
from evoros.base.elementary import pairs, tables

_GRID = 6755399441055744.0
"""1.5 * 2**52: a number plus this, minus this, is rounded to an integer."""
_EIGHTH = 0.7853981633974483
_MANY = 1e6
"""[rad]: up to here, the number of quarter turns has at most 20 bits."""
_CLOSE = 1e-7
"""[rad]: closer to a multiple of a quarter turn, three parts of pi are not enough."""
_BASE = 16777216.0  # 2**DIGIT
_BLOCKS = 4
_LEAST = 2.0**-192  # the weight of the last digit


@inlined
def reduce_angle(x: float) -> tuple[int, float, float]:
    """Return the nearest quarter turn (0 to 3) to x [rad] and the pair that remains of x.

    It remains to about 100 bits. The angle must be finite.
    """
    size = abs(x)
    if size <= _EIGHTH:
        return 0, x, 0.0
    if size <= _MANY:
        turns = (x * tables.TWO_OVER_PI + _GRID) - _GRID
        # Both products and the first difference are exact (Cody and Waite).
        high, low = pairs.add(x - turns * tables.HALF_PI_1, -turns * tables.HALF_PI_2)
        if abs(high) > _CLOSE:
            high, low = pairs.add_smaller(high, low - turns * tables.HALF_PI_3)
            return int(turns) & 3, high, low
    quarter, high, low = _reduce_long(size)
    if x < 0.0:
        return -quarter & 3, -high, -low
    return quarter, high, low


@compilable
def _reduce_long(x: float) -> tuple[int, float, float]:
    """Multiply x by 2/pi digit by digit, without the digits that make whole turns.

    This is the method of Payne and Hanek. Digits have 24 bits, so that all sums are exact.
    """
    places = (math.frexp(x)[1] - 1) // tables.DIGIT
    x0, rest = _split_digit(math.ldexp(x, -tables.DIGIT * places))
    x1, rest = _split_digit(rest * _BASE)
    x2, rest = _split_digit(rest * _BASE)
    x3 = rest * _BASE
    digit, carry = _digit(x0, x1, x2, x3, places + 2 * _BLOCKS, 0.0)
    scale = _LEAST
    high = 0.0
    low = 0.0
    for block in range(_BLOCKS - 1, -1, -1):  # two digits each
        second, carry = _digit(x0, x1, x2, x3, places + 2 * block + 1, carry)
        digit, carry = _digit(x0, x1, x2, x3, places + 2 * block, carry)
        part = (digit * _BASE + second) * scale
        scale *= _BASE * _BASE
        if block == 0 and digit >= 0.5 * _BASE:
            part -= 1.0
        high, error = pairs.add(part, high)
        low += error
    whole = int(_digit(x0, x1, x2, x3, places - 1, carry)[0])
    if digit >= 0.5 * _BASE:
        whole += 1
    high, low = pairs.add_smaller(high, low)
    product, error = pairs.multiply(high, tables.HALF_PI_HIGH)
    error += high * tables.HALF_PI_LOW + low * tables.HALF_PI_HIGH
    product, error = pairs.add_smaller(product, error)
    return whole & 3, product, error


@compilable
def _split_digit(x: float) -> tuple[float, float]:
    """Return the integer part and the rest."""
    whole = float(int(x))
    return whole, x - whole


@compilable
def _digit(
    x0: float, x1: float, x2: float, x3: float, place: int, carry: float
) -> tuple[float, float]:
    """Return a digit of the product with 2/pi, and what is carried to the place before."""
    total = carry
    digits = tables.TWO_OVER_PI_DIGITS
    if place >= 0:
        total += x0 * float(digits[place])
    if place >= 1:
        total += x1 * float(digits[place - 1])
    if place >= 2:
        total += x2 * float(digits[place - 2])
    if place >= 3:
        total += x3 * float(digits[place - 3])
    carry = float(int(total / _BASE))
    return total - carry * _BASE, carry
