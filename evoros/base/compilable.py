"""Marks functions that rules call, so that numba compiles them together with the rules.

numba takes long to import, so it learns of them only when a rule is compiled.
"""

from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])

_waiting: list[tuple[Callable[..., Any], bool]] = []


def compilable(function: Function) -> Function:
    """Decorate a function that rules call, so that numba compiles it together with them."""
    _waiting.append((function, False))
    return function


def inlined(function: Function) -> Function:
    """Decorate a function as ``compilable`` does, that takes less time than its call would."""
    _waiting.append((function, True))
    return function


def take_waiting() -> list[tuple[Callable[..., Any], bool]]:
    """Return the functions that were marked since the last call, and whether to inline them."""
    taken = _waiting.copy()
    del _waiting[: len(taken)]
    return taken
