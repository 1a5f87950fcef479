"""Normal and exponential deviates by the ziggurat method, bitwise equal on every processor.

The tables are numba's private copy of numpy's; only rare deviates differ from numpy's.
"""

from numba.np.random import _constants as layers
from numpy.random import BitGenerator

from evoros.base.compilable import compilable
from evoros.base.elementary import exp, log1p

_MANTISSA = 0x000FFFFFFFFFFFFF  # 52 bits
_LEAST = 2.0**-53
_REJECTED = 1e300

WIDTHS, INSIDE = layers.wi_double, layers.ki_double


def next_word(bits: BitGenerator) -> int:
    """Draw 64 random bits; compiled code has a different implementation."""
    word: int = bits.random_raw()
    return word


@compilable
def _draw_share(bits: BitGenerator) -> float:
    return float(next_word(bits) >> 11) * _LEAST


@compilable
def draw_normal(bits: BitGenerator) -> float:
    """Draw a normal deviate with mean 0 and standard deviation 1."""
    while True:
        word = next_word(bits)
        i = word & 0xFF
        whole = (word >> 9) & _MANTISSA
        x = float(whole) * float(WIDTHS[i])
        if word & 0x100:
            x = -x
        if whole < int(INSIDE[i]):
            return x
        x = _draw_at_edge(bits, int(i), int(whole), x)
        if x != _REJECTED:
            return x


@compilable
def _draw_at_edge(bits: BitGenerator, i: int, whole: int, x: float) -> float:
    """Return x if accepted at the edge of a layer, a deviate from the tail, or ``_REJECTED``."""
    if i == 0:
        tail = _draw_tail(bits)
        return -tail if (whole >> 8) & 0x1 else tail
    low = float(layers.fi_double[i])
    width = float(layers.fi_double[i - 1]) - low
    return x if width * _draw_share(bits) + low < exp(-0.5 * x * x) else _REJECTED


@compilable
def _draw_tail(bits: BitGenerator) -> float:
    """Draw a deviate below the lowest layer's edge, in the tail (Marsaglia's method)."""
    while True:
        x = -float(layers.ziggurat_nor_inv_r) * log1p(-_draw_share(bits))
        y = -log1p(-_draw_share(bits))
        if y + y > x * x:
            return float(layers.ziggurat_nor_r) + x


@compilable
def draw_exponential(bits: BitGenerator) -> float:
    """Draw an exponential deviate with mean 1."""
    while True:
        word = next_word(bits) >> 3
        i = word & 0xFF
        word >>= 8
        x = float(word) * float(layers.we_double[i])
        if word < int(layers.ke_double[i]):
            return x
        if i == 0:
            return float(layers.ziggurat_exp_r) - log1p(-_draw_share(bits))
        low = float(layers.fe_double[i])
        width = float(layers.fe_double[i - 1]) - low
        if width * _draw_share(bits) + low < exp(-x):
            return x
