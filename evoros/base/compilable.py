"""Marks functions called in rules; they are registered late, because numba imports slowly."""

from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])

_waiting: list[tuple[Callable[..., Any], bool]] = []


def compilable(function: Function) -> Function:
    """Mark a function that is called in rules."""
    _waiting.append((function, False))
    return function


def inlined(function: Function) -> Function:
    """Mark a function that is called in rules and should be inlined."""
    _waiting.append((function, True))
    return function


def is_bundled(function: Callable[..., Any]) -> bool:
    """Return True if a function belongs to evoros, False if to a user."""
    return function.__module__.partition(".")[0] == "evoros"


def take_waiting(bundled: bool) -> list[tuple[Callable[..., Any], bool]]:
    """Return evoros's or users' functions marked since the last call, with inline flags."""
    taken = [entry for entry in _waiting if is_bundled(entry[0]) is bundled]
    _waiting[:] = [entry for entry in _waiting if entry not in taken]
    return taken
