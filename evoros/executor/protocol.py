"""The protocols of executors: each opens a pool of workers."""

from collections.abc import Callable
from concurrent.futures import Future
from contextlib import AbstractContextManager
from typing import Any, NamedTuple, Protocol, runtime_checkable

from evoros.executor.payload import Shared


class Pool(Protocol):
    """The workers of an open executor; ``submit`` is as in ``concurrent.futures.Executor``."""

    @property
    def workers(self) -> int:
        """The number of calls that run at the same time, now; a cluster's workers come and go."""
        ...

    @property
    def shares_files(self) -> bool:
        """Whether the workers see the files of this process under the same paths.

        If not, this process draws its figures itself.
        """
        ...

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        """Call ``function(*args)`` in a worker; function and arguments must pickle.

        The future raises the exception of the function, or WorkerLost if the call crashed its
        process or hung, also when it was retried. A function that raises PilotLost is retried in
        the same way. RunStopped reports that there are no workers any more, whatever the call. A
        ``Shared`` argument travels once to each worker.
        """
        ...


class Batches(NamedTuple):
    """How the workers of a pool run missions together; see ``evoros.executor.gpu``."""

    device: str
    missions: int  # at most, in a launch
    fallback: str


@runtime_checkable
class BatchPool(Protocol):
    """A pool whose workers run missions together; those of others run them one after another."""

    @property
    def batches(self) -> Batches:
        """How they do."""
        ...

    def join(
        self, function: Callable[..., Any], run: object, share: float, shared: Shared, asked: Any
    ) -> "Future[Any]":
        """Add a part, which has a share of a whole call, to the next call of a worker.

        A worker calls ``function(batches, [asked, ...], shared, ...)``, with one part of each of
        several runs, and returns the list of their answers. If the call fails, each part is called
        alone. The future is as in ``Pool.submit``.
        """
        ...


@runtime_checkable
class Executor(Protocol):
    """Runs calls in workers. No result may depend on the choice of executor."""

    def open(self) -> AbstractContextManager[Pool]:
        """Start the workers. Leaving the context ends all calls, whatever they are doing.

        Raises:
            InputError: the executor cannot be used, whatever is done outside.
            RunStopped: there are no workers, and once there are the run can go on.
        """
        ...
