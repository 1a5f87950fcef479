"""Reads the code of a GPU for operations that would give other bits than this processor."""

import re

_ARITHMETIC = re.compile(
    r"\b(?:add|sub|mul|div|fma|mad|sqrt|rcp|rsqrt|sin|cos|tanh|ex2|lg2|min|max)"
    r"\.[\w.:]*\bf(?:16|16x2|32|64)\b"
)
_EXACT = re.compile(r"(?:(?:add|sub|mul|div|sqrt|rcp)\.rn|min|max)\.f64")
_OTHER = re.compile(
    r"\.extern\s+\.func[^;]*|\.callprototype|[\w.]*\.(?:ftz|approx|full|sat)\b[\w.]*"
)


def find_inexact(ptx: str) -> list[str]:
    """Return the operations of PTX that are not rounded as IEEE 754 says, each once.

    Such are fused multiplications and additions, approximations, other numbers than of 64 bits, and
    calls of functions that the code lacks.
    """
    arithmetic = [found[0] for found in _ARITHMETIC.finditer(ptx)]
    wrong = [name for name in arithmetic if not _EXACT.fullmatch(name)]
    wrong += [" ".join(found[0].split()) for found in _OTHER.finditer(ptx)]
    return list(dict.fromkeys(wrong))
