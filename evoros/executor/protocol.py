"""The base class of executors, and pools of workers."""

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
    """The workers of an open executor; ``submit`` is as in ``concurrent.futures.Executor``."""

    @property
    def workers(self) -> int:
        """The number of calls that can run in parallel, which varies on a cluster."""

    @property
    def shares_files(self) -> bool:
        """True if workers can access the files of this process, for example to draw figures."""

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        """Run ``function(*args)`` in a worker; raise an InputError if they cannot be pickled.

        The future raises the function's exception, WorkerLost if every attempt crashed or hung, or
        RunStopped if there are no workers left. Calls that raise PilotLost are repeated, too.
        ``Shared`` arguments are sent to each worker only once.
        """


ALONE = float("inf")  # the ``share`` of a part that needs a call for itself


class Batches(Protocol):
    """The settings for simulating several missions together in a worker; frozen and picklable."""

    @property
    def option(self) -> str:
        """The override that selects these settings, such as executor=gpu."""

    @property
    def device(self) -> str:
        """The device's name in messages."""

    @property
    def missions(self) -> int:
        """The maximum number of missions simulated together."""

    def open_device(self) -> "Device":
        """Open the device in a worker; raise a DeviceError if it is unusable."""

    def give_up(self, reason: str) -> str:
        """Return a note that missions run one by one because of ``reason``, or stop the run."""


@runtime_checkable
class BatchPool(Protocol):
    """A pool whose workers can simulate several missions together."""

    @property
    def batches(self) -> Batches:
        """The settings for simulating missions together."""

    def join(
        self, function: Callable[..., Any], run: object, share: float, shared: "Shared", asked: Any
    ) -> "Future[Any]":
        """Add ``asked``, which fills the fraction ``share`` of a call, to a worker's next call.

        A worker calls ``function(batches, [asked, ...], shared, ...)`` with one part per run, which
        returns a list with one result per part. If the call fails, each part is called separately.
        The future is as in ``Pool.submit``.
        """


class Executor(ABC):
    """Runs calls in workers. No result may depend on the executor."""

    @abstractmethod
    def open(self) -> AbstractContextManager[Pool]:
        """Start the workers; leaving the context ends all calls, even if they hang.

        Unusable settings raise an InputError, a lack of workers a RunStopped.
        """


KEPT = 16  # maximum number of cached shared arguments
# Kinds of ``Answer``; a call with the answer ``MISSING`` is sent again with its shared arguments.
MISSING, RETURNED, RAISED, PILOT_LOST = range(4)


@dataclass(frozen=True)
class Shared:
    """An argument of many calls, as bytes that are sent only to processes without them."""

    digest: bytes  # SHA-256, compared instead of the content
    content: bytes = field(compare=False, repr=False)

    @classmethod
    def of(cls, content: bytes) -> "Shared":
        """Return the content with its SHA-256 digest."""
        return cls(hashlib.sha256(content).digest(), content)


@dataclass(frozen=True)
class Call:
    """A pickled call, and its shared arguments, which the pickle refers to by digest."""

    name: str
    payload: bytes = field(repr=False)
    shared: tuple[Shared, ...] = ()


class Answer(NamedTuple):
    """A process's answer: the pickled result or exception, empty if ``MISSING``."""

    kind: int
    content: bytes = b""


class MissingError(Exception):
    """A shared argument of the call is not cached in the process."""


class Kept:
    """The shared arguments cached in a process."""

    def __init__(self) -> None:
        self._kept: OrderedDict[bytes, Shared] = OrderedDict()
        self._lock = Lock()

    def add(self, contents: Sequence[Shared]) -> None:
        """Cache shared arguments; drop the longest unused ones if there are more than ``KEPT``."""
        with self._lock:
            for shared in contents:
                self._kept[shared.digest] = shared
                self._kept.move_to_end(shared.digest)
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)

    def get(self, digest: bytes) -> Shared:
        """Return a cached argument; raise a MissingError if it is not cached."""
        with self._lock:
            if digest not in self._kept:
                raise MissingError
            self._kept.move_to_end(digest)
            return self._kept[digest]


@dataclass(frozen=True)
class _Reference:
    digest: bytes


def pack_call(function: Callable[..., Any], args: Sequence[Any]) -> Call:
    """Pickle a call; raise an InputError if its function or an argument cannot be pickled."""
    name = getattr(function, "__qualname__", None) or repr(function)
    shared = tuple(arg for arg in args if isinstance(arg, Shared))
    sent = tuple(_Reference(arg.digest) if isinstance(arg, Shared) else arg for arg in args)
    try:
        return Call(name, pickle.dumps((function, sent)), shared)
    except Exception as error:  # a user's __reduce__ may raise any exception
        raise InputError(
            f"{name}: cannot be sent to a worker process ({error}); define functions and "
            f"classes at the top level of an importable module, or use executor=serial"
        ) from error


def unpack_call(payload: bytes, kept: Kept) -> tuple[Callable[..., Any], tuple[Any, ...]]:
    """Unpickle a call; raise a MissingError if a shared argument is not in ``kept``."""
    function, sent = pickle.loads(payload)
    args = (kept.get(arg.digest) if isinstance(arg, _Reference) else arg for arg in sent)
    return function, tuple(args)


# Libraries read these variables on import. NUMBA_NUM_THREADS is not set, because numba refuses a
# change after the main process has started its threads.
ONE_THREAD = (
    *("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"),
    *("BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS"),
)
"""Variables that limit numeric libraries to one thread in each of the processes, one per core."""
