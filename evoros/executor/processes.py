"""The executor with local worker processes, which survives calls that crash or hang."""

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
    """Runs calls in worker processes, which isolate calls that crash or hang.

    A worker is a fresh interpreter, which starts in 0.12 s with numpy; a fork server takes 0.03 s,
    but its imports and environment would be outdated. A worker has the current ``sys.path`` and
    imports the main script, which needs the guard ``if __name__ == "__main__"``. Numeric libraries
    use one thread per worker, because there is a worker per core.

    Workers run on Linux and macOS only. ``workers`` of 0 or None means the number of usable cores.
    """

    workers: Annotated[int, null_or_whole(0)] = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "workers", self.workers or available_cores())

    @contextmanager
    def open(self) -> Iterator[Pool]:
        """Start the workers; the exit kills all with their children, and cancels open futures."""
        with _one_thread_each(), _importable_main_script(), _known_start_method():
            pool = _WorkerPool(self)
            try:
                pool.start()
                yield pool
            finally:
                pool.close()


def available_cores() -> int:
    """Return the number of processor cores available to this process."""
    if sys.platform == "linux":  # macOS has no processor affinity
        return min(len(os.sched_getaffinity(0)), read_quota(Path("/sys/fs/cgroup")))
    return os.cpu_count() or 1


def read_quota(group: Path) -> int:
    """Return the CPU quota of a container in cores, rounded up; ``sys.maxsize`` if it has none."""
    with suppress(OSError, ValueError):  # "max" means no quota
        quota, period = map(int, (group / "cpu.max").read_text().split())
        return math.ceil(quota / period)
    with suppress(OSError, ValueError):  # version 1 of cgroups, in which -1 means no quota
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
        # A thread can wait for this future and for an answer simultaneously.
        self._closing: Future[None] = Future()
        self._lock = Lock()  # held while a call is submitted or the pool is closed
        self._threads = [Thread(target=self._serve, daemon=True) for _ in range(settings.workers)]

    def start(self) -> None:
        # The terminal sends Ctrl-C to all its processes, but only the main process handles it.
        # Workers inherit the blocked signal, so they ignore it even during imports. The resource
        # tracker is started first, because its start unblocks the signal.
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
            with suppress(OSError, RuntimeError):  # reported by the first call, which tries again
                worker.start()
            while call := self._calls.get():
                if not call.future.set_running_or_notify_cancel():
                    continue
                try:
                    answer = settings.attempt(call.call, worker)
                except BaseException as error:  # passed to the caller; this thread must continue
                    call.future.set_exception(error)
                else:
                    settle(call.future, answer)
        finally:
            worker.stop()


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Limit workers to one thread by environment variables, which numpy reads on import."""
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
    """Hide a start method that joblib sets in its processes and that spawned workers lack."""
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
    """Hide a main script that workers cannot import: standard input, or a deleted file."""
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
