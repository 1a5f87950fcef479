"""Gives rules the elementary functions of evoros in place of Python's and numpy's.

A rule may name them as ``math.sin``, as ``np.sin`` or, after ``from math import sin``, as ``sin``.
"""

import math
from inspect import isfunction
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
from numba import vectorize

from evoros.base import elementary
from evoros.base.compilable import compilable, is_bundled

_OF_BOTH = ("cos", "cosh", "exp", "expm1", "log", "log1p", "log2", "log10", "sin", "sinh", "tan")
_OF_NUMPY = {"acos": "arccos", "asin": "arcsin", "atan": "arctan", "atan2": "arctan2"}
_OF_NUMPY |= {name: name for name in (*_OF_BOTH, "tanh", "hypot", "power")}


@compilable
def _log(x: float, base: float = math.e) -> float:
    """Return the logarithm of x to a base."""
    value = elementary.log(x)
    return value if base == math.e else value / elementary.log(base)


@compilable
def _hypot(x: float, y: float = 0.0, z: float = 0.0) -> float:
    """Return the length of a vector."""
    value = elementary.hypot(x, y)
    return value if z == 0.0 else elementary.hypot(value, z)


def _copy_module(module: ModuleType, replaced: dict[str, Any]) -> ModuleType:
    copy = ModuleType(module.__name__)
    copy.__dict__.update({**module.__dict__, **replaced})
    return copy


_own_math = {name: getattr(elementary, name) for name in (*_OF_BOTH, "tanh")}
_own_math |= {name: getattr(elementary, name) for name in ("acos", "asin", "atan", "atan2")}
_own_math |= {"pow": elementary.power, "log": _log, "hypot": _hypot}
# numpy's work on arrays, too.
_own_numpy = {numpys: vectorize(getattr(elementary, name)) for name, numpys in _OF_NUMPY.items()}
_MODULES = {math: _copy_module(math, _own_math), np: _copy_module(np, _own_numpy)}
_FUNCTIONS = {
    getattr(module, name): function
    for module, replaced in ((math, _own_math), (np, _own_numpy))
    for name, function in replaced.items()
}


def substitute(function: Any, helpers: bool = False) -> Any:
    """Return a plain function with the elementary functions of evoros.

    With ``helpers``, the plain functions of its module that it calls get them as well; to compile
    it, numba must know these by themselves.
    """
    if not isfunction(function) or is_bundled(function):
        return function
    return _substitute(function, helpers, {})


def _substitute(function: FunctionType, helpers: bool, known: dict[Any, Any]) -> FunctionType:
    names = _names(function.__code__)
    space = function.__globals__
    replaced = dict(space)
    known[function] = copy = FunctionType(
        function.__code__, replaced, function.__name__, function.__defaults__, function.__closure__
    )
    copy.__kwdefaults__ = function.__kwdefaults__
    copy.__qualname__, copy.__module__ = function.__qualname__, function.__module__
    for name in names & space.keys():
        value = space[name]
        if isinstance(value, ModuleType):
            replaced[name] = _MODULES.get(value, value)
        elif helpers and isfunction(value) and value.__globals__ is space:
            replaced[name] = known.get(value) or _substitute(value, helpers, known)
        elif callable(value) and type(value).__hash__ is not None:
            replaced[name] = _FUNCTIONS.get(value, value)
    return copy


def _names(code: Any) -> set[str]:
    inner = (constant for constant in code.co_consts if hasattr(constant, "co_names"))
    return set(code.co_names).union(*map(_names, inner))
