"""What an executor must offer: a pool of workers."""

from collections.abc import Callable
from concurrent.futures import Future
from contextlib import AbstractContextManager
from typing import Any, Protocol, runtime_checkable


class Pool(Protocol):
    """A started executor. ``submit`` is that of ``concurrent.futures.Executor``."""

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        """Call ``function(*args)`` in a worker; both must pickle.

        The future raises what the function raised, or WorkerLost where the call crashed its
        process or hung, once more often than it may be retried.
        """
        ...


@runtime_checkable
class Executor(Protocol):
    """Where missions are computed. No result may depend on it."""

    @property
    def workers(self) -> int:
        """How many calls run at the same time."""
        ...

    def open(self) -> AbstractContextManager[Pool]:
        """Start the workers; leaving the context ends every one of them, whatever it does."""
        ...
