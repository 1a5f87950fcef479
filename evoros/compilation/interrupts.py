"""Defers signal handlers while compiled code runs."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from threading import current_thread, main_thread
from typing import Any, TypeAlias

NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGALRM", "SIGUSR1", "SIGUSR2")
HELD = [getattr(signal, name) for name in NAMES if hasattr(signal, name)]
"""Signals for which programs install Python handlers; Windows lacks some of them."""

Release: TypeAlias = Callable[[Callable[[], object]], None]
"""Calls a function without deferring handlers; raises exceptions from handlers."""


@contextmanager
def hold_interrupts() -> Iterator[Release]:
    """Defer signal handlers until the end, except during calls through the yielded function."""
    handlers: dict[int, Callable[[int, Any], object]] = {}  # numba crashes if converters raise
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

    with ExitStack() as stack:  # restores all handlers, even if one raises
        stack.callback(deliver)
        if current_thread() is main_thread():  # only the main thread may set and run handlers
            for signum in HELD:
                handler = signal.getsignal(signum)
                if callable(handler):
                    handlers[signum] = handler
                    stack.callback(signal.signal, signum, handler)
                    signal.signal(signum, note)
        yield release
