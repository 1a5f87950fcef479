"""Elementary functions, bitwise equal on every processor, compiled or interpreted.

The C library and numpy choose among implementations by processor, and these differ in the last
digits. Here, everything is a fixed sequence of sums, products, quotients and square roots, which
IEEE 754 defines to the last bit. Errors are below 1 unit in the last place for ``sin``, ``cos``,
``exp``, ``log``, ``log1p`` and ``power``, below 3 for ``asin``, ``acos``, ``sinh`` and ``tanh``,
and below 2 for the other functions. Functions return NaN or infinity instead of raising errors.
"""

from evoros.base.elementary.exponential import cosh, exp, expm1, sinh, tanh
from evoros.base.elementary.inverse import acos, asin, atan, atan2, hypot
from evoros.base.elementary.logarithm import log, log1p, log2, log10, power
from evoros.base.elementary.trigonometry import cos, sin, sin_cos, tan

__all__ = [
    "acos", "asin", "atan", "atan2", "cos", "cosh", "exp", "expm1", "hypot", "log", "log1p", "log2",
    "log10", "power", "sin", "sin_cos", "sinh", "tan", "tanh",
]  # fmt: skip
