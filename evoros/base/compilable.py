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


def is_bundled(function: Callable[..., Any]) -> bool:
    """Whether a function is one of evoros, not of a user."""
    return function.__module__.partition(".")[0] == "evoros"


def take_waiting(bundled: bool) -> list[tuple[Callable[..., Any], bool]]:
    """Return the functions marked since the last call, and whether to inline them.

    They are either evoros's or users'.
    """
    taken = [entry for entry in _waiting if is_bundled(entry[0]) is bundled]
    _waiting[:] = [entry for entry in _waiting if entry not in taken]
    return taken
