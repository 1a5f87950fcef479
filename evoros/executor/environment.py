"""The software and the arithmetic of a process, which must be equal in all that run missions."""

import hashlib
import math
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.rng import generator
from evoros.files.resources import PACKAGE

ENGINES = ("mujoco-core", "pybullet")
"""Needed by some runs only: they must be of the same version where they are installed."""
ARITHMETIC = "arithmetic"
LIBRARY = "C library"
SAMPLES = 256
"""Points at which evoros's functions are compared."""
UNARY = (
    *(elementary.sin, elementary.cos, elementary.tan, elementary.atan, elementary.tanh),
    *(elementary.exp, elementary.expm1, elementary.sinh, elementary.cosh),
    *(elementary.log, elementary.log1p, elementary.log2, elementary.log10),
)
INVERSE = (elementary.asin, elementary.acos)  # from 0 to 1
BINARY = (elementary.atan2, elementary.hypot, elementary.power)
DEVIATES = 10_000
"""One normal deviate in 4000 is from the tail, and one exponential in 2200."""
LIBRARY_SAMPLES = 20_000
"""Points for the C library, more because few of its values differ between processors."""


@cache
def describe_environment() -> Mapping[str, str]:
    """Return the software and the arithmetic on which results depend, by name.

    ``ARITHMETIC`` is a digest of the bits of evoros's functions. ``LIBRARY`` is one of the bits of
    the C library's, which differ among its versions and processors.
    """
    software = {
        "python": ".".join(map(str, sys.version_info[:2])),
        "evoros": f"of sources {_digest_of_sources()}",
        "numpy": np.__version__,
        "numba": _version("numba"),
        ARITHMETIC: _digest_of_elementary(),
        LIBRARY: _digest_of_library(),
    }
    return software | {name: _version(name) for name in ENGINES}


def list_differences(wanted: Mapping[str, str]) -> list[str]:
    """List in words how this process differs from another one, but for the C library.

    Only some missions depend on the C library.
    """
    here = describe_environment()
    return [
        f"{name} {here.get(name) or '(not installed)'} and not {value}"
        for name, value in wanted.items()
        if name != LIBRARY
        and here.get(name, "") != value
        and not (name in ENGINES and not (here.get(name) and value))
    ]


def has_library(wanted: Mapping[str, str]) -> bool:
    """Whether the C library computes the same here as in the other process."""
    return describe_environment()[LIBRARY] == wanted.get(LIBRARY)


def _version(package: str) -> str:
    """Return the version of a package; empty if it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def _digest_of_sources() -> str:
    """Return a digest of the package's code, without the folders that a checkout has beside it."""
    digest = hashlib.sha256()
    for file in sorted(PACKAGE.rglob("*.py")):
        name = file.relative_to(PACKAGE)
        if name.parts[0] not in ("analysis", "conf"):
            content = file.read_bytes()
            digest.update(f"{name.as_posix()}:{len(content)}:".encode() + content)
    return digest.hexdigest()[:8]


def _digest_of_elementary() -> str:
    """Return a digest of evoros's functions, which have the same bits on every processor."""
    points = _points(SAMPLES)
    values = [np.array([function(x) for x in points.tolist()]) for function in UNARY]
    values += [np.array([function(x) for x in (points / 21.0).tolist()]) for function in INVERSE]
    pairs = list(zip(points.tolist(), points[::-1].tolist(), strict=True))
    values += [np.array([function(x, y) for x, y in pairs]) for function in BINARY]
    return _digest([*values, *draw_deviates()])


def draw_deviates() -> tuple[Array, Array]:
    """Draw normal and exponential deviates, some of them from the tails of the generator."""
    rng = generator("environment", "deviates")
    return rng.standard_normal(DEVIATES), rng.standard_exponential(DEVIATES)


def _digest_of_library() -> str:
    """Return a digest of functions as the C library computes them, for engines among others."""
    points = _points(LIBRARY_SAMPLES).tolist()
    functions = (math.sin, math.cos, math.tan, math.atan, math.exp, math.log)
    return _digest([np.array([function(x) for x in points]) for function in functions])


def _points(count: int) -> Array:
    return (np.arange(1.0, count + 1.0) * 0.7390851332151607) % 20.0 + 1e-3


def _digest(values: Sequence[Array]) -> str:
    return hashlib.sha256(np.concatenate(values).astype("<f8").tobytes()).hexdigest()[:8]
