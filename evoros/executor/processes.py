"""The executor of local worker processes, which survives calls that crash or hang."""

import math
import multiprocessing
import os
import queue
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing import resource_tracker
from pathlib import Path
from threading import Lock, Thread
from typing import Annotated, Any

from evoros.base.checks import checked, null_or_whole
from evoros.executor.protocol import ONE_THREAD, Call, Executor, Pool, pack_call
from evoros.executor.worker_handle import Limits, Worker, settle


@dataclass(frozen=True)
@checked
class Processes(Limits, Executor):
    """Runs calls in worker processes. A call that crashes or hangs does not affect others.

    A worker is a fresh interpreter (0.12 s with numpy; a fork server takes 0.03 s, but its imports
    and environment would be outdated). It gets the current ``sys.path`` and imports the main
    script, which must therefore guard its code with ``if __name__ == "__main__"``. A worker's
    numeric libraries use one thread, because there is a worker per core.

    Workers run on Linux and macOS only. ``workers`` of 0 or None is the number of usable cores.
    """

    workers: Annotated[int, null_or_whole(0)] = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "workers", self.workers or available_cores())

    @contextmanager
    def open(self) -> Iterator[Pool]:
        """Start the workers; leaving the context kills every worker with its children.

        Unfinished futures then raise CancelledError. The workers also die with the main process.
        """
        with _one_thread_each(), _importable_main_script(), _known_start_method():
            pool = _WorkerPool(self)
            try:
                pool.start()
                yield pool
            finally:
                pool.close()


def available_cores() -> int:
    """Return the number of cores that this process may use."""
    if sys.platform == "linux":  # only Linux can confine a process to some of the cores
        return min(len(os.sched_getaffinity(0)), read_quota(Path("/sys/fs/cgroup")))
    return os.cpu_count() or 1


def read_quota(group: Path) -> int:
    """Return a container's CPU quota in cores, rounded up; ``sys.maxsize`` without a quota."""
    with suppress(OSError, ValueError):  # an unlimited quota is the word "max"
        quota, period = map(int, (group / "cpu.max").read_text().split())
        return math.ceil(quota / period)
    with suppress(OSError, ValueError):  # cgroups version 1, where -1 means no quota
        texts = ((group / "cpu" / f"cpu.cfs_{name}_us").read_text() for name in ("quota", "period"))
        quota, period = map(int, texts)
        return math.ceil(quota / period) if quota > 0 else sys.maxsize
    return sys.maxsize


@dataclass(frozen=True, eq=False)
class _QueuedCall:
    call: Call
    future: "Future[Any]" = field(default_factory=Future)


class _WorkerPool:
    def __init__(self, settings: Processes) -> None:
        self.workers, self.shares_files = settings.workers, True
        self._settings = settings
        self._calls: queue.SimpleQueue[_QueuedCall | None] = queue.SimpleQueue()
        # A thread can wait for this future and an answer at the same time.
        self._closing: Future[None] = Future()
        self._lock = Lock()  # prevents submissions after close
        self._threads = [Thread(target=self._serve, daemon=True) for _ in range(settings.workers)]

    def start(self) -> None:
        # Ctrl-C reaches every process in the terminal, but only the main process handles it.
        # Threads and processes inherit the blocked signal, so a worker ignores Ctrl-C even while
        # importing. The resource tracker starts first, because starting it unblocks the signal.
        resource_tracker.ensure_running()
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            for thread in self._threads:
                thread.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        call = _QueuedCall(pack_call(function, args))
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
        settings = self._settings
        worker = Worker(self._closing, settings.time_limit_s, settings.calls_per_worker)
        try:
            with suppress(OSError, RuntimeError):  # the first call retries and reports the error
                worker.start()
            while call := self._calls.get():
                if not call.future.set_running_or_notify_cancel():
                    continue
                try:
                    answer = settings.attempt(call.call, worker)
                except BaseException as error:  # goes to the caller; this thread must continue
                    call.future.set_exception(error)
                else:
                    settle(call.future, answer)
        finally:
            worker.stop()


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Limit workers' threads by environment variables, because workers import numpy first."""
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
def _known_start_method() -> Iterator[None]:
    """Hide a start method that joblib sets in its processes but that spawned workers lack."""
    before = multiprocessing.get_start_method(allow_none=True)
    if before is None or before in multiprocessing.get_all_start_methods():
        yield
        return
    multiprocessing.set_start_method("spawn", force=True)
    try:
        yield
    finally:
        multiprocessing.set_start_method(before, force=True)


@contextmanager
def _importable_main_script() -> Iterator[None]:
    """Hide a main script that workers cannot import: read from standard input, or deleted."""
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
