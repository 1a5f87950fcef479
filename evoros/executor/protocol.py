"""The base class of executors, which open pools of workers."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from evoros.executor.payload import Shared

if TYPE_CHECKING:
    from evoros.compilation.device import Device


class Pool(Protocol):
    """The workers of an open executor; ``submit`` works as in ``concurrent.futures.Executor``."""

    @property
    def workers(self) -> int:
        """The current number of parallel calls; workers of a cluster come and go."""

    @property
    def shares_files(self) -> bool:
        """True if the workers see the files of this process under the same paths.

        Otherwise this process draws its figures itself.
        """

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        """Call ``function(*args)`` in a worker; function and arguments must pickle.

        The future raises the exception of the function, or WorkerLost if the call crashed its
        process or hung in all attempts. A function that raises PilotLost is retried, too.
        RunStopped reports that no workers are left. A ``Shared`` argument is sent once to each
        worker.

        Raises:
            InputError: the function or an argument does not pickle.
            RuntimeError: the pool is closed.
        """


ALONE = float("inf")
"""The share of a part that runs in a separate call."""


class Batches(Protocol):
    """Settings for running missions together in workers, as a frozen value that pickles."""

    @property
    def option(self) -> str:
        """The override that users type, such as executor=gpu."""

    @property
    def device(self) -> str:
        """The name of the device."""

    @property
    def missions(self) -> int:
        """The maximum number of missions in a launch."""

    def open_device(self) -> "Device":
        """Open the device in a worker.

        Raises:
            DeviceError: the device cannot be used.
        """

    def give_up(self, reason: str) -> str:
        """Return a message that missions run one by one for a reason.

        Raises:
            RunStopped: the run must stop instead.
        """


@runtime_checkable
class BatchPool(Protocol):
    """A pool whose workers run missions together; workers of other pools run them one by one."""

    @property
    def batches(self) -> Batches:
        """The settings for running missions together."""

    def join(
        self, function: Callable[..., Any], run: object, share: float, shared: Shared, asked: Any
    ) -> "Future[Any]":
        """Add a part, which fills a share of a call, to the next call of a worker.

        A worker calls ``function(batches, [asked, ...], shared, ...)`` with one part per run, and
        returns a list with their answers. If the call fails, each part is called alone. The future
        behaves as in ``Pool.submit``.
        """


class Executor(ABC):
    """Runs calls in workers. No result may depend on the choice of executor."""

    @abstractmethod
    def open(self) -> AbstractContextManager[Pool]:
        """Start the workers; leaving the context ends all calls, even if they hang.

        Raises:
            InputError: the settings of the executor must be changed.
            RunStopped: there are no workers; the run can continue once there are.
        """
