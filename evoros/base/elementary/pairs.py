"""Sums and products of doubles with their rounding errors; a pair (high, low) is their sum.

Every operation is one of IEEE 754, rounded to nearest, so that each processor gives the same bits.
"""

from evoros.base.compilable import inlined

SPLIT = 134217729.0
"""2**27 + 1, which divides a double into two halves (Veltkamp)."""


@inlined
def add(a: float, b: float) -> tuple[float, float]:
    """Return a + b as a pair (Knuth's two-sum)."""
    high = a + b
    back = high - a
    return high, (a - (high - back)) + (b - back)


@inlined
def add_smaller(a: float, b: float) -> tuple[float, float]:
    """Return a + b as a pair, for a of the greater magnitude or 0 (Dekker's fast two-sum)."""
    high = a + b
    return high, b - (high - a)


@inlined
def multiply(a: float, b: float) -> tuple[float, float]:
    """Return a b as a pair (Dekker's product); neither must exceed 1e290."""
    high = a * b
    t = SPLIT * a
    a1 = t - (t - a)
    a2 = a - a1
    t = SPLIT * b
    b1 = t - (t - b)
    b2 = b - b1
    return high, ((a1 * b1 - high) + a1 * b2 + a2 * b1) + a2 * b2


@inlined
def divide(n: float, n_low: float, d: float, d_low: float) -> tuple[float, float]:
    """Return the quotient of two pairs as a pair."""
    high = n / d
    inverse = 1.0 / d  # at the same time
    back, error = multiply(high, d)
    return high, ((((n - back) - error) + n_low) - high * d_low) * inverse
