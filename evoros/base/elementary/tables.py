"""Tables and constants of the elementary functions, from their series in integer arithmetic.

Nothing here is typed in: each value is computed to ``BITS`` bits when the module is imported, and
then divided into doubles whose sum it is.
"""

from fractions import Fraction

import numpy as np

from evoros.base.arrays import Array

BITS = 200
"""Fractional bits of the fixed-point numbers."""
_ONE = 1 << BITS

ANGLES = 27
"""Angles up to more than pi/4, in steps of 1/32."""
DIGIT = 24
"""Bits of a digit of 2/pi."""
_DIGITS = 56
"""Digits of 2/pi: for the greatest double, and 192 bits below one quarter turn."""


def _series(first: int, ratios: "list[tuple[int, int]]") -> int:
    total = term = first
    for numerator, denominator in ratios:
        term = term * numerator // denominator >> BITS
        total += term
    return total


def _sin_cos(angle: int) -> tuple[int, int]:
    squared = -angle * angle >> BITS
    sin = _series(angle, [(squared, i * (i + 1)) for i in range(2, 60, 2)])
    return sin, _series(_ONE, [(squared, i * (i + 1)) for i in range(1, 60, 2)])


def _exp(x: int) -> int:
    return _series(_ONE, [(x, i) for i in range(1, 60)])


def _atan(numerator: int, denominator: int, one: int = _ONE) -> int:
    """Return the arctangent of a fraction of at most 1, by Euler's series."""
    squared = numerator * numerator
    whole = squared + denominator * denominator
    total = term = one * numerator * denominator // whole
    i = 1
    while term:
        term = term * 2 * i * squared // ((2 * i + 1) * whole)
        total += term
        i += 1
    return total


def _log(numerator: int, denominator: int) -> int:
    """Return the logarithm of a fraction, by the series of its area hyperbolic tangent."""
    n, d = numerator - denominator, numerator + denominator
    term = 2 * _ONE * n // d
    total, i = 0, 1
    while abs(term) > 1:
        total += term // i
        term = term * n * n // (d * d)
        i += 2
    return total


def _pi(one: int) -> int:
    """Return pi, by Machin's formula."""
    return 16 * _atan(1, 5, one) - 4 * _atan(1, 239, one)


def _parts(value: int, *bits: int) -> list[float]:
    """Divide a number into doubles: of so many significant bits each, and a last one of 53."""
    parts = []
    for count in bits:
        spare = max(abs(value).bit_length() - count, 0)
        part = (value + (1 << spare >> 1) >> spare) << spare
        parts.append(part / _ONE)
        value -= part
    return [*parts, value / _ONE]


def _columns(rows: "list[list[float]]") -> list[Array]:
    return [np.array(column) for column in zip(*rows, strict=True)]


_PI = _pi(_ONE)
_LN2 = _log(2, 1)

PI_HIGH, PI_LOW = _parts(_PI, 53)
HALF_PI_HIGH, HALF_PI_LOW = PI_HIGH / 2, PI_LOW / 2
HALF_PI_1, HALF_PI_2, HALF_PI_3 = _parts(_PI // 2, 33, 33)
TWO_OVER_PI = float(Fraction(2 * _ONE, _PI))
_INVERSE = (2 << (DIGIT * (_DIGITS + 3)) * 2) // _pi(1 << DIGIT * (_DIGITS + 3))
TWO_OVER_PI_DIGITS: Array = np.array(
    [(_INVERSE >> DIGIT * (_DIGITS + 2 - i)) & ((1 << DIGIT) - 1) for i in range(_DIGITS)],
    dtype=np.float64,
)

_TURNS = [_sin_cos(i * _ONE // 32) for i in range(ANGLES)]
SIN_HIGH, SIN_LOW = _columns([_parts(sin, 53) for sin, _ in _TURNS])
COS_HIGH, COS_LOW = _columns([_parts(cos, 53) for _, cos in _TURNS])
SIN_1, SIN_2 = _columns([_parts(sin, 20) for sin, _ in _TURNS])
COS_1, COS_2 = _columns([_parts(cos, 20) for _, cos in _TURNS])

ATAN_HIGH, ATAN_LOW = _columns([_parts(_atan(i, 32) if i else 0, 53) for i in range(33)])

LN2_53_HIGH, LN2_53_LOW = _parts(_LN2, 53)
LN2_128_1, LN2_128_2 = _parts(_LN2 // 128, 33)
EXP_STEPS = float(Fraction(128 * _ONE, _LN2))
EXP_HIGH, EXP_LOW = _columns([_parts(_exp(_LN2 * i // 128), 53) for i in range(128)])
POWERS: Array = np.ldexp(1.0, np.arange(-1022, 1024))
"""2**-1022 ... 2**1023."""

LOG_FIRST = 90
"""The first row of the table of logarithms: for numbers near 90/128."""
_INVERSES = [512 * 128 // i if i != 128 else 512 for i in range(LOG_FIRST, 183)]
LOG_INVERSE: Array = np.array(_INVERSES) / 512.0
_GRID = BITS - 42  # sums of these, and of multiples of LN2_HIGH, are exact
_LOGS = [_log(512, i) for i in _INVERSES]
LOG_HIGH: Array = np.array([((value >> _GRID) << _GRID) / _ONE for value in _LOGS])
LOG_LOW: Array = np.array([(value - ((value >> _GRID) << _GRID)) / _ONE for value in _LOGS])
LN2_HIGH = ((_LN2 >> _GRID) << _GRID) / _ONE
LN2_LOW = (_LN2 - ((_LN2 >> _GRID) << _GRID)) / _ONE
LOG2E_HIGH, LOG2E_LOW = _parts(_ONE * _ONE // _LN2, 53)
LOG10E_HIGH, LOG10E_LOW = _parts(_ONE * _ONE // _log(10, 1), 53)
