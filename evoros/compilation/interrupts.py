"""Holds back the handlers of signals while compiled code runs."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from threading import current_thread, main_thread
from typing import Any

NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGALRM", "SIGUSR1", "SIGUSR2")
HELD = [getattr(signal, name) for name in NAMES if hasattr(signal, name)]
"""The signals for which programs have handlers in Python; Windows lacks some."""


@contextmanager
def hold_interrupts() -> Iterator[Callable[[], None]]:
    """Hold back the handlers of signals until the end; the yielded function calls those due before.

    A handler may raise, as Ctrl-C's does, wherever Python code runs in the main thread. numba
    runs some to convert arguments and results, and does not survive an exception there.
    """
    handlers: dict[int, Callable[[int, Any], object]] = {}
    due: list[int] = []

    def note(signum: int, frame: Any) -> None:
        due.append(signum)

    def deliver() -> None:
        while due:
            signum = due.pop(0)
            handlers[signum](signum, sys._getframe())

    with ExitStack() as stack:  # each handler comes back, even if one of the others raises then
        stack.callback(deliver)
        if current_thread() is main_thread():  # no other thread may set a handler, or runs one
            for signum in HELD:
                handler = signal.getsignal(signum)
                if callable(handler):
                    handlers[signum] = handler
                    stack.callback(signal.signal, signum, handler)
                    signal.signal(signum, note)
        yield deliver
