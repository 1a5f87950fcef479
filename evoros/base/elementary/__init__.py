"""Elementary functions with the same bits on every processor, compiled and interpreted.

The C library and numpy choose among several implementations by what the processor offers, and
these differ in their last digits. Here, everything is built of sums, products, quotients and square
roots, which IEEE 754 defines to the last bit. Instead of raising errors, functions return NaN or
infinity.
"""

from evoros.base.elementary.exponential import exp, expm1, log, log1p, log2, log10
from evoros.base.elementary.inverse import acos, asin, atan, atan2
from evoros.base.elementary.mapped import atan2_all, cos_all, sin_all
from evoros.base.elementary.powers import cosh, hypot, power, sinh, tanh
from evoros.base.elementary.trigonometry import cos, sin, sin_cos, tan

__all__ = [
    "acos",
    "asin",
    "atan",
    "atan2",
    "atan2_all",
    "cos",
    "cos_all",
    "cosh",
    "exp",
    "expm1",
    "hypot",
    "log",
    "log1p",
    "log2",
    "log10",
    "power",
    "sin",
    "sin_all",
    "sin_cos",
    "sinh",
    "tan",
    "tanh",
]
