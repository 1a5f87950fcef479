"""The serial executor for debugging, in the main process."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from evoros.executor.protocol import Executor, Pool


@dataclass(frozen=True)
class Serial(Executor):
    """Runs each call in the main process when it is submitted.

    Debuggers work as usual. There is no time limit and no retry; a crash ends the run.
    """

    @contextmanager
    def open(self) -> Iterator[Pool]:
        """Open the pool, which needs no start or end."""
        yield _MainProcess()


class _MainProcess:
    workers, shares_files = 1, True

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        future: Future[Any] = Future()
        future.set_running_or_notify_cancel()
        try:
            future.set_result(function(*args))
        except Exception as error:  # Ctrl-C and sys.exit take effect immediately
            future.set_exception(error)
        return future
