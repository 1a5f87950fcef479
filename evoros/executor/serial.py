"""Calls in the main process, for debugging."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from evoros.executor.protocol import Pool


@dataclass(frozen=True)
class Serial:
    """Each call runs in the main process, at the moment it is submitted.

    Breakpoints, profilers and tracebacks work as in any function. There is no time limit and no
    retry: nothing here could end a call that hangs, and one that crashes ends the run.
    """

    @property
    def workers(self) -> int:
        """Always one: the main process."""
        return 1

    @contextmanager
    def open(self) -> Iterator[Pool]:
        """Nothing to start, nothing to end."""
        yield _Here()


class _Here:
    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        """The finished future of ``function(*args)``."""
        future: Future[Any] = Future()
        future.set_running_or_notify_cancel()
        try:
            future.set_result(function(*args))
        except Exception as error:  # Ctrl-C and sys.exit act at once, as anywhere in this process
            future.set_exception(error)
        return future
