"""Announcements of activities other than missions, such as compilation and drawing."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Event, Thread

from evoros.terminal.log import LOGGER

SLOW_S = 5.0  # interval [s] between messages about an activity
_LISTENER: ContextVar[Callable[[str], object] | None] = ContextVar("listener", default=None)
_ACTIVITY: ContextVar[str] = ContextVar("activity", default="")


@contextmanager
def listen(listener: Callable[[str], object]) -> Iterator[None]:
    """Call the listener with each activity announced by this thread."""
    token = _LISTENER.set(listener)
    try:
        yield
    finally:
        _LISTENER.reset(token)


@contextmanager
def announce(activity: str) -> Iterator[None]:
    """Announce an activity of this thread, and at its end the previous one again."""
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


@contextmanager
def tell_slow(activity: str) -> Iterator[None]:
    """Log this thread's activity, at first ``activity``, every ``SLOW_S``."""
    now, done, start = [activity], Event(), time.monotonic()

    def tell() -> None:
        while not done.wait(SLOW_S):
            LOGGER.info("%s, %.0f s so far", now[0], time.monotonic() - start)

    def note(text: str) -> None:
        now[0] = text or activity

    teller = Thread(target=tell, daemon=True)
    with listen(note):
        teller.start()
        try:
            yield
        finally:
            done.set()
            teller.join()
