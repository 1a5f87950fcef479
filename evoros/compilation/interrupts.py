"""Holds back the handlers of signals while compiled code runs."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from threading import current_thread, main_thread
from typing import Any, TypeAlias

NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGALRM", "SIGUSR1", "SIGUSR2")
HELD = [getattr(signal, name) for name in NAMES if hasattr(signal, name)]
"""The signals for which programs have handlers in Python; Windows lacks some."""

Release: TypeAlias = Callable[[Callable[[], object]], None]
"""Calls a function, during which no handler is held back; it raises what a handler raises."""


@contextmanager
def hold_interrupts() -> Iterator[Release]:
    """Hold back the handlers of signals until the end, but for calls of the yielded function.

    A handler may raise, as Ctrl-C's does, wherever Python code runs in the main thread. numba
    runs some to convert arguments and results, and does not survive an exception there.
    """
    handlers: dict[int, Callable[[int, Any], object]] = {}
    due: list[int] = []
    held = True

    def note(signum: int, frame: Any) -> None:
        if held:
            due.append(signum)
        else:
            handlers[signum](signum, frame)

    def deliver() -> None:
        while due:
            signum = due.pop(0)
            handlers[signum](signum, sys._getframe())

    def release(function: Callable[[], object]) -> None:
        nonlocal held
        try:
            held = False
            if due:
                deliver()
            function()
        finally:
            held = True

    with ExitStack() as stack:  # each handler comes back, even if one of the others raises then
        stack.callback(deliver)
        if current_thread() is main_thread():  # no other thread may set a handler, or runs one
            for signum in HELD:
                handler = signal.getsignal(signum)
                if callable(handler):
                    handlers[signum] = handler
                    stack.callback(signal.signal, signum, handler)
                    signal.signal(signum, note)
        yield release
