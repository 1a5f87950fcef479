"""Carries calls by mpi4py.futures."""

import socket
import sys
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from threading import Event, Lock, Thread, Timer
from time import monotonic
from typing import Any

from mpi4py import MPI
from mpi4py.futures import MPIPoolExecutor

from evoros.base.errors import RunStopped
from evoros.executor import mpi_heartbeat, node
from evoros.executor.mpi_heartbeat import Silences
from evoros.executor.remote import RawAnswer
from evoros.terminal.console import STOPPED

COMMAND = "mpiexec -n RANKS python -m mpi4py.futures -m evoros ..."
LOOK_S = 0.5
"""Time between two looks of the main process for heartbeats [s]."""
PAUSE_S = 2.0
"""Two looks that are further apart [s] are so because this process did not run."""
ABORT_S = 10.0
"""After this time [s] the job is ended by force if a rank does not answer: it would wait for it."""


def answer(wanted: dict[str, str], request: bytes) -> RawAnswer:
    """Run a call in a rank; see ``node.answer``."""
    mpi_heartbeat.begin()
    name = f"rank {MPI.COMM_WORLD.Get_rank()} on {socket.gethostname()}"
    return (*node.answer(wanted, request), name)


@contextmanager
def connect() -> Iterator["MpiTransport"]:
    """Take the ranks of the job.

    Raises:
        RunStopped: there are none, or this is not the first one.
    """
    ranks = MPI.COMM_WORLD.Get_size()
    if "mpi4py.futures" not in sys.orig_argv or ranks < 2:
        raise RunStopped(
            f"executor=mpi: must be started as an MPI job of at least 2 ranks, the first of which "
            f"runs evoros; type: {COMMAND}"
        )
    transport = MpiTransport(MPIPoolExecutor(main=False), ranks - 1, Silences())
    try:
        yield transport
    finally:
        transport.close()


class MpiTransport:
    """Sends each call as one task. A rank that is silent for too long ends the run."""

    def __init__(self, executor: Any, workers: int, silences: Silences) -> None:
        self.workers = workers
        self._executor, self._silences = executor, silences
        self._out: dict[Future[RawAnswer], Future[RawAnswer]] = {}  # by the task that carries it
        self._lock, self._closing = Lock(), Event()
        self._lost: RunStopped | None = None
        self._watcher = Thread(target=self._watch, daemon=True)
        self._watcher.start()

    def send(
        self, name: str, wanted: dict[str, str], request: bytes, node: str | None
    ) -> "Future[RawAnswer]":
        """See ``Transport``; a rank cannot be chosen.

        Raises:
            RunStopped: a rank does not answer.
        """
        sent: Future[RawAnswer] = Future()
        with self._lock:
            if self._lost is not None:
                raise self._lost
            task = self._executor.submit(answer, wanted, request)
            self._out[task] = sent
        sent.add_done_callback(lambda done: task.cancel() if done.cancelled() else None)
        task.add_done_callback(self._receive)
        return sent

    def exclude(self, node: str, reason: str) -> None:
        """See ``Transport``; all ranks of a job must fit."""
        raise RunStopped(f"executor=mpi: {node} cannot run missions: {reason}")

    def stop(self, pool: str) -> None:
        """See ``Transport``; MPI does not reach a rank that is busy."""

    def close(self) -> None:
        """Forget all calls; a rank ends the one that it has begun before it takes another.

        This does not wait for them: if the job is being ended, there is hardly a second left.
        """
        self._closing.set()
        self._watcher.join(LOOK_S)  # before MPI is finalized
        self._executor.shutdown(wait=False, cancel_futures=True)

    def _receive(self, task: "Future[RawAnswer]") -> None:
        with self._lock:
            sent = self._out.pop(task, None)
        if sent is None:
            return
        if task.cancelled():
            sent.cancel()
        if sent.set_running_or_notify_cancel():
            error = task.exception()
            if error is None:
                sent.set_result(task.result())
            else:
                sent.set_exception(error)

    def _watch(self) -> None:
        """Look for a rank that is silent."""
        before = monotonic()
        while not self._closing.wait(LOOK_S):
            now = monotonic()
            passed, before = min(now - before, PAUSE_S), now
            with self._lock:
                running = sum(task.running() for task in self._out)
            lost = self._silences.pass_time(passed, mpi_heartbeat.receive(), running)
            if lost:
                fix = "start the job without its machine"
                self._lose(RunStopped(f"executor=mpi: {lost}; {fix}"))
                return

    def _lose(self, reason: RunStopped) -> None:
        abort = Timer(ABORT_S, MPI.COMM_WORLD.Abort, (STOPPED,))  # MPI waits for all ranks
        abort.daemon = True
        abort.start()
        with self._lock:
            self._lost = reason
            out, self._out = self._out, {}
        for sent in out.values():
            if sent.set_running_or_notify_cancel():
                sent.set_exception(reason)
