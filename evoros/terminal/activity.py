"""The activities of the program besides missions, for displays: compiling, drawing."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_LISTENER: ContextVar[Callable[[str], object] | None] = ContextVar("listener", default=None)
_ACTIVITY: ContextVar[str] = ContextVar("activity", default="")


@contextmanager
def listen(listener: Callable[[str], object]) -> Iterator[None]:
    """Tell the listener of the activities that this thread announces."""
    token = _LISTENER.set(listener)
    try:
        yield
    finally:
        _LISTENER.reset(token)


@contextmanager
def announce(activity: str) -> Iterator[None]:
    """Announce an activity of this thread; afterwards, announce the earlier one again."""
    token = _ACTIVITY.set(activity)
    _tell()
    try:
        yield
    finally:
        _ACTIVITY.reset(token)
        _tell()


def _tell() -> None:
    listener = _LISTENER.get()
    if listener is not None:
        listener(_ACTIVITY.get())
