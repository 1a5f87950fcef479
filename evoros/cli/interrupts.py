"""SIGINT and SIGTERM of a command: both end its runs cleanly, with different exit statuses."""

import os
import signal
import time
from types import FrameType

from evoros.terminal.console import STOPPED, explain_interrupt

PATIENCE_S = 10.0


class Interrupts:
    """A context manager that turns the first SIGINT or SIGTERM into KeyboardInterrupt.

    Later signals do not disturb the orderly end. If it takes longer than ``PATIENCE_S``, the next
    one ends the process at once.
    """

    def __init__(self) -> None:
        self.last: int | None = None  # the signal that came last
        self._first_s: float | None = None  # of time.monotonic

    def __enter__(self) -> "Interrupts":
        self._handlers = {
            signum: signal.signal(signum, self._interrupt)
            for signum in (signal.SIGINT, signal.SIGTERM)
            if signal.getsignal(signum) != signal.SIG_IGN  # as under nohup
        }
        return self

    def __exit__(self, *_: object) -> None:
        for signum, handler in self._handlers.items():
            signal.signal(signum, handler)

    def _interrupt(self, signum: int, frame: FrameType | None) -> None:
        self.last = signum
        if self._first_s is not None:
            if time.monotonic() - self._first_s > PATIENCE_S:
                os._exit(self.explain()[1])  # the workers die with it, and runs are resumable
            return
        self._first_s = time.monotonic()
        # Not an Exception: code that catches those, such as logging, must not swallow it.
        raise KeyboardInterrupt

    def explain(self) -> tuple[str, int]:
        """Return a message about the last signal, and the exit status that it means."""
        if self.last == signal.SIGTERM:
            return "terminated by a signal", STOPPED
        return explain_interrupt()
