"""The base class of executors, which open pools of workers."""

import hashlib
import pickle
from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from threading import Lock
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, runtime_checkable

from evoros.base.errors import InputError

if TYPE_CHECKING:
    from evoros.compilation.device import Device


class Pool(Protocol):
    """The workers of an open executor; ``submit`` works as in ``concurrent.futures.Executor``."""

    @property
    def workers(self) -> int:
        """The current number of parallel calls; a cluster's workers come and go."""

    @property
    def shares_files(self) -> bool:
        """True if workers see the files of this process, so that they can draw the figures."""

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        """Call ``function(*args)`` in a worker; raise an InputError if anything does not pickle.

        The future raises the function's exception, WorkerLost if every attempt crashed its process
        or hung, or RunStopped if no workers are left. A call that raises PilotLost is also retried.
        A ``Shared`` argument is sent once to each worker.
        """


ALONE = float("inf")  # the ``share`` of a part that must be alone in its call


class Batches(Protocol):
    """Settings for running missions together in workers, as a frozen, picklable value."""

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
        """Open the device in a worker; raise a DeviceError if it cannot be used."""

    def give_up(self, reason: str) -> str:
        """Say that missions run one by one because of ``reason``, or raise a RunStopped."""


@runtime_checkable
class BatchPool(Protocol):
    """A pool whose workers run missions together; workers of other pools run them one by one."""

    @property
    def batches(self) -> Batches:
        """The settings for running missions together."""

    def join(
        self, function: Callable[..., Any], run: object, share: float, shared: "Shared", asked: Any
    ) -> "Future[Any]":
        """Add ``asked`` to a worker's next call; ``share`` is the fraction of a call that it fills.

        A worker calls ``function(batches, [asked, ...], shared, ...)`` with one part per run, and
        returns a list of the results. If the call fails, each part is called alone. The future
        behaves as in ``Pool.submit``.
        """


class Executor(ABC):
    """Runs calls in workers. No result may depend on the choice of executor."""

    @abstractmethod
    def open(self) -> AbstractContextManager[Pool]:
        """Start the workers; leaving the context ends all calls, even if they hang.

        Raises:
            InputError: the executor's settings cannot be used.
            RunStopped: there are no workers; the run can continue once there are.
        """


KEPT = 16  # maximum number of shared arguments cached in a process
# Kinds of ``Answer``; after ``MISSING``, the call is repeated with its shared arguments.
MISSING, RETURNED, RAISED, PILOT_LOST = range(4)


@dataclass(frozen=True)
class Shared:
    """Bytes that are an argument of many calls, sent only to processes that lack them."""

    digest: bytes  # SHA-256, so that comparisons need 32 bytes and not megabytes
    content: bytes = field(compare=False, repr=False)

    @classmethod
    def of(cls, content: bytes) -> "Shared":
        """Return the content with its digest."""
        return cls(hashlib.sha256(content).digest(), content)


@dataclass(frozen=True)
class Call:
    """A pickled call, and the shared arguments that the pickle names by digest."""

    name: str
    payload: bytes = field(repr=False)
    shared: tuple[Shared, ...] = ()


class Answer(NamedTuple):
    """A process's answer, with the pickled result or exception unless ``MISSING``."""

    kind: int
    content: bytes = b""


class MissingError(Exception):
    """The process has not cached one of the call's shared arguments."""


class Kept:
    """The shared arguments cached in a process."""

    def __init__(self) -> None:
        self._kept: OrderedDict[bytes, Shared] = OrderedDict()
        self._lock = Lock()

    def add(self, contents: Sequence[Shared]) -> None:
        """Cache shared arguments; beyond ``KEPT``, drop the one unused for longest."""
        with self._lock:
            for shared in contents:
                self._kept[shared.digest] = shared
                self._kept.move_to_end(shared.digest)
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)

    def get(self, digest: bytes) -> Shared:
        """Return a shared argument; raise a MissingError if it is not cached."""
        with self._lock:
            if digest not in self._kept:
                raise MissingError
            self._kept.move_to_end(digest)
            return self._kept[digest]


@dataclass(frozen=True)
class _Reference:
    digest: bytes


def pack_call(function: Callable[..., Any], args: Sequence[Any]) -> Call:
    """Pickle a call; raise an InputError if the function or an argument does not pickle."""
    name = getattr(function, "__qualname__", None) or repr(function)
    shared = tuple(arg for arg in args if isinstance(arg, Shared))
    sent = tuple(_Reference(arg.digest) if isinstance(arg, Shared) else arg for arg in args)
    try:
        return Call(name, pickle.dumps((function, sent)), shared)
    except Exception as error:  # a user's __reduce__ may raise anything
        raise InputError(
            f"{name}: cannot be sent to a worker process ({error}); define functions and "
            f"classes at the top level of an importable module, or use executor=serial"
        ) from error


def unpack_call(payload: bytes, kept: Kept) -> tuple[Callable[..., Any], tuple[Any, ...]]:
    """Unpickle a call; raise a MissingError if ``kept`` lacks one of its shared arguments."""
    function, sent = pickle.loads(payload)
    args = (kept.get(arg.digest) if isinstance(arg, _Reference) else arg for arg in sent)
    return function, tuple(args)


# The libraries read these on import. NUMBA_NUM_THREADS is left out, because numba refuses to change
# it in a main process that has already started numba's threads.
ONE_THREAD = (
    *("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"),
    *("BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS"),
)
"""Variables set to 1 in each process that computes missions, because there is one per core."""
