"""Worker processes on this machine that survive calls which crash or hang."""

import os
import pickle
import queue
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing import resource_tracker
from threading import Lock, Thread
from typing import Annotated, Any

from evoros.base.checks import POSITIVE, WHOLE, Rule, checked, is_whole
from evoros.base.errors import InputError, WorkerLost
from evoros.executor.protocol import Pool
from evoros.executor.worker_handle import LostError, Worker

# Read by the numeric libraries as they are imported. Not NUMBA_NUM_THREADS: numba would refuse
# the change in a main process that has already started numba's threads.
ONE_THREAD = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)


def _null_or_whole(least: int) -> Rule:
    return Rule(
        f"a whole number of at least {least}, or null",
        lambda v: v is None or (is_whole(v) and v >= least),
    )


@dataclass(frozen=True)
@checked
class Processes:
    """Calls run in worker processes; one that crashes or hangs costs only itself.

    A worker is a fresh interpreter (spawn: measured 0.12 s with numpy; a fork server's 0.03 s
    are not worth a process whose environment and imports are those of an earlier moment). It
    gets ``sys.path`` as it is when the worker starts, and imports the main script, which
    therefore needs its ``if __name__ == "__main__"``. Its numeric libraries use one thread,
    because there are as many workers as cores.

    A call that ends its process with exit code 0 is noticed only at the time limit.

    Linux and macOS. ``workers`` of 0 or None becomes the number of cores this process may use.

    Raises:
        InputError: a value breaks its rule.
    """

    workers: Annotated[int, _null_or_whole(0)] = 0
    time_limit_s: Annotated[float, POSITIVE] = 600.0  # wall clock, for one attempt at one call
    retries: Annotated[int, WHOLE] = 1  # further attempts at a call that crashed or hung
    calls_per_worker: Annotated[int | None, _null_or_whole(1)] = None  # None: no limit

    def __post_init__(self) -> None:
        object.__setattr__(self, "workers", self.workers or available_cores())

    @contextmanager
    def open(self) -> Iterator[Pool]:
        """Start the workers. Leaving waits for no call and kills every worker with its children.

        Calls that are not finished then raise CancelledError. A worker also dies with the main
        process, however that ends.
        """
        with _one_thread_each(), _importable_main_script():
            crew = _Crew(self)
            try:
                crew.start()
                yield crew
            finally:
                crew.close()


def available_cores() -> int:
    """How many cores the system lets this process use."""
    if sys.platform == "linux":  # others cannot confine a process to some of the cores
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@dataclass(frozen=True, eq=False)
class _Call:
    name: str
    payload: bytes
    future: "Future[Any]" = field(default_factory=Future)


class _Crew:
    """The pool: a queue of calls, and for each worker one thread that serves it."""

    def __init__(self, settings: Processes) -> None:
        self._settings = settings
        self._calls: queue.SimpleQueue[_Call | None] = queue.SimpleQueue()
        self._closing: Future[None] = Future()  # a future, to be waited for along with an answer
        self._lock = Lock()  # between the last submit and close
        self._threads = [Thread(target=self._serve, daemon=True) for _ in range(settings.workers)]

    def start(self) -> None:
        # Threads and processes inherit the blocked signal: Ctrl-C, which reaches every process
        # in the terminal, is the main process's alone even while a worker is still importing.
        # Python's resource tracker comes first, because starting it unblocks the signal.
        resource_tracker.ensure_running()
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            for thread in self._threads:
                thread.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        """Call ``function(*args)`` in a worker; InputError where they do not pickle."""
        name = getattr(function, "__qualname__", None) or repr(function)
        try:
            call = _Call(name, pickle.dumps((function, args)))
        except Exception as error:  # whatever a user's __reduce__ raises
            raise InputError(
                f"{name}: cannot be sent to a worker process ({error}); define functions and "
                f"classes at the top of a module that can be imported, or use executor=serial"
            ) from error
        with self._lock:
            if self._closing.done():
                raise RuntimeError("this pool is closed")
            self._calls.put(call)
        return call.future

    def close(self) -> None:
        with self._lock:
            self._closing.set_result(None)
        with suppress(queue.Empty):
            while call := self._calls.get_nowait():
                call.future.cancel()
                call.future.set_running_or_notify_cancel()
        started = [thread for thread in self._threads if thread.ident is not None]
        for _ in started:
            self._calls.put(None)
        for thread in started:
            thread.join()

    def _serve(self) -> None:
        worker = Worker(self._closing, self._settings.time_limit_s, self._settings.calls_per_worker)
        try:
            with suppress(OSError, RuntimeError):  # the first call will try again, and tell
                worker.start()
            while call := self._calls.get():
                if call.future.set_running_or_notify_cancel():
                    self._settle(call, worker)
        finally:
            worker.stop()

    def _settle(self, call: _Call, worker: Worker) -> None:
        try:
            returned, value = pickle.loads(self._answer(call, worker))
        except BaseException as error:  # this thread must live on, and the caller must hear
            returned, value = False, error
        if returned:
            call.future.set_result(value)
        else:
            call.future.set_exception(value)

    def _answer(self, call: _Call, worker: Worker) -> bytes:
        """Attempt the call until it is answered, as often as the settings allow."""
        attempts = self._settings.retries + 1
        for _ in range(attempts - 1):
            with suppress(LostError):
                return worker.answer(call.payload)
        try:
            return worker.answer(call.payload)
        except LostError as lost:
            times = "once" if attempts == 1 else f"{attempts} times, the last time"
            raise WorkerLost(
                f"{call.name}: lost {times} because {lost.what}; {lost.cure}"
            ) from lost


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """In the environment, because a worker imports numpy before it runs any code of ours."""
    before = {name: os.environ.pop(name, None) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value


@contextmanager
def _importable_main_script() -> Iterator[None]:
    """Hide a main script that workers could not import: read from standard input, or deleted."""
    main = sys.modules["__main__"]
    file = getattr(main, "__file__", None)
    if file is None or main.__spec__ is not None or os.path.isfile(file):
        yield
        return
    del main.__file__
    try:
        yield
    finally:
        main.__file__ = file
