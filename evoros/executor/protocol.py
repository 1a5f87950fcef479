"""The protocols of executors: each opens a pool of workers."""

from collections.abc import Callable
from concurrent.futures import Future
from contextlib import AbstractContextManager
from typing import Any, Protocol, runtime_checkable


class Pool(Protocol):
    """The workers of an open executor; ``submit`` is that of ``concurrent.futures.Executor``."""

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        """Call ``function(*args)`` in a worker; function and arguments must pickle.

        The future raises the exception of the function, or WorkerLost if the call crashed its
        process or hung, also when it was retried. A function that raises PilotLost is
        retried in the same way.
        """
        ...


@runtime_checkable
class Executor(Protocol):
    """Runs calls in workers. No result may depend on the choice of executor."""

    @property
    def workers(self) -> int:
        """The number of calls that run at the same time."""
        ...

    def open(self) -> AbstractContextManager[Pool]:
        """Start the workers. Leaving the context ends all of them, whatever they are doing."""
        ...
