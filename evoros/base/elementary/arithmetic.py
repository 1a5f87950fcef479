"""Exact sums and products, rounding and polynomials of doubles, bitwise equal everywhere."""

import numpy as np

from evoros.base.arrays import Array
from evoros.base.compilable import inlined

_GRID = 6755399441055744.0  # 1.5 * 2**52, near which doubles have a spacing of 1
_SPLIT = 134217729.0  # 2**27 + 1, for splitting a double into two halves (Veltkamp)

_HALFWAY = 540
_POWERS: Array = np.ldexp(1.0, np.arange(-_HALFWAY, _HALFWAY + 1))


@inlined
def nearest(x: float) -> float:
    """Return the integer nearest to x, for magnitudes up to 2**51."""
    return (x + _GRID) - _GRID


@inlined
def scale(x: float, k: int) -> float:
    """Return x * 2**k, for k from -1080 to 1080."""
    # two factors avoid intermediate under- and overflow
    half = k >> 1
    return x * float(_POWERS[half + _HALFWAY]) * float(_POWERS[k - half + _HALFWAY])


@inlined
def add(a: float, b: float) -> tuple[float, float]:
    """Return a + b and its rounding error (Knuth's two-sum)."""
    total = a + b
    back = total - a
    return total, (a - (total - back)) + (b - back)


@inlined
def split(a: float) -> tuple[float, float]:
    """Return the two 26-bit halves of a; the magnitude of a must not exceed 1e300."""
    t = _SPLIT * a
    upper = t - (t - a)
    return upper, a - upper


@inlined
def multiply(a: float, b: float) -> tuple[float, float]:
    """Return a * b and its rounding error (Dekker's product)."""
    product = a * b
    a1, a2 = split(a)
    b1, b2 = split(b)
    return product, ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2


@inlined
def polynomial(x: float, coefficients: tuple[float, ...]) -> float:
    """Evaluate a polynomial with coefficients in ascending order (Horner's scheme)."""
    value = coefficients[-1]
    for i in range(len(coefficients) - 2, -1, -1):
        value = value * x + coefficients[i]
    return value
