"""The serial executor, which runs calls in the main process, for debugging."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from evoros.executor.protocol import Executor, Pool


@dataclass(frozen=True)
class Serial(Executor):
    """Runs calls in the main process during ``submit``, for debuggers: no limits, no retries."""

    @contextmanager
    def open(self) -> Iterator[Pool]:
        """Yield a pool without worker processes."""
        yield _MainProcess()


class _MainProcess:
    workers, shares_files = 1, True

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        future: Future[Any] = Future()
        future.set_running_or_notify_cancel()
        try:
            future.set_result(function(*args))
        except Exception as error:  # does not catch Ctrl-C and sys.exit
            future.set_exception(error)
        return future
