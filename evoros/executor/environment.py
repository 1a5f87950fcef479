"""The software and the arithmetic of a process, which must be equal in all that run missions."""

import hashlib
import math
import platform
import sys
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from evoros import __version__
from evoros.base.resources import PACKAGE

ENGINES = ("mujoco-core", "pybullet")
"""Needed by some runs only: they must be of the same version where they are installed."""
ARITHMETIC = "arithmetic"
SAMPLES = 4096


@cache
def describe_environment() -> Mapping[str, str]:
    """Return what results depend on beside the experiment, by name.

    ``arithmetic`` has the processor's architecture and a digest of the bits that elementary
    functions return. They differ between C libraries, and within one between processors.
    """
    found = {
        "python": ".".join(map(str, sys.version_info[:2])),
        "evoros": f"{__version__} (sources {_digest_of_sources()})",
        "numpy": np.__version__,
        "numba": _version("numba"),
        ARITHMETIC: f"{platform.machine()} {_digest_of_functions()}",
    }
    return found | {name: _version(name) for name in ENGINES}


def list_differences(wanted: Mapping[str, str]) -> list[str]:
    """List in words what this process has and another one, which computes with it, has not."""
    here = describe_environment()
    return [
        f"{name} {here.get(name) or '(not installed)'} and not {value}"
        for name, value in wanted.items()
        if here.get(name, "") != value and not (name in ENGINES and not (here.get(name) and value))
    ]


def _version(package: str) -> str:
    """Return the version of a package; empty if it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def _digest_of_sources() -> str:
    """Return a digest of the package's code: two checkouts may have the same version.

    Without the folders that a wheel has inside and a checkout beside the package.
    """
    digest = hashlib.sha256()
    for file in sorted(PACKAGE.rglob("*.py")):
        name = file.relative_to(PACKAGE)
        if name.parts[0] not in ("analysis", "conf"):
            content = file.read_bytes()
            digest.update(f"{name.as_posix()}:{len(content)}:".encode() + content)
    return digest.hexdigest()[:8]


def _digest_of_functions() -> str:
    """Return a digest of functions as the C library and as numpy compute them."""
    x = (np.arange(1.0, SAMPLES + 1.0) * 0.7390851332151607) % 20.0 + 1e-3
    library = (math.sin, math.cos, math.tan, math.atan, math.exp, math.log, math.sqrt)
    values = [np.array([function(each) for each in x.tolist()]) for function in library]
    values += [np.array([math.atan2(a, b) for a, b in zip(x, x[::-1], strict=True)])]
    values += [np.sin(x), np.cos(x), np.arctan2(x, x[::-1]), np.exp(x), np.log(x), np.sqrt(x)]
    values += [np.random.default_rng(0).standard_normal(SAMPLES)]
    return hashlib.sha256(np.concatenate(values).astype("<f8").tobytes()).hexdigest()[:8]
