"""Runs calls in the main process, for debugging."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from evoros.executor.protocol import Pool


@dataclass(frozen=True)
class Serial:
    """Runs each call in the main process, when it is submitted.

    Breakpoints, profilers and tracebacks work as usual. There is no time limit and no retry: a
    call that hangs goes on forever, and one that crashes the process ends the run.
    """

    @contextmanager
    def open(self) -> Iterator[Pool]:
        """Open the pool; there is nothing to start or to end."""
        yield _MainProcess()


class _MainProcess:
    workers, shares_files = 1, True

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        """Call ``function(*args)``; returns a finished future."""
        future: Future[Any] = Future()
        future.set_running_or_notify_cancel()
        try:
            future.set_result(function(*args))
        except Exception as error:  # Ctrl-C and sys.exit act at once
            future.set_exception(error)
        return future
