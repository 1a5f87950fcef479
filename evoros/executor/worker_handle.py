"""The main process's handle on a worker process, and on the calls tried in it.

Workers have separate Pebble pools; a shared one (5.2) can report a crash for another call.
"""

import os
import pickle
import signal
import time
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Annotated, Any

from pebble import ProcessExpired, ProcessPool

from evoros.base.checks import POSITIVE, WHOLE, checked, null_or_whole
from evoros.base.errors import WorkerLost
from evoros.executor.descendants import SWEEPER, MarkedProcess, kill_marked
from evoros.executor.protocol import MISSING, PILOT_LOST, RAISED, RETURNED, Answer, Call, Shared
from evoros.executor.worker_main import prepare, run_call

START_LIMIT_S = 120.0  # maximum time for starting a process and importing the main script
EXIT_S = 10.0  # maximum time for a process to exit after its pipe is closed
LOOK_S = 1.0  # interval at which the process of a running call is checked


class NoAnswerError(Exception):
    """A call was tried without an answer."""

    def __init__(self, reason: str, fix: str) -> None:
        super().__init__(reason, fix)
        self.reason, self.fix = reason, fix


class _Spawn(SpawnContext):
    """Spawns processes and remembers the last one, which Pebble does not expose."""

    newest: MarkedProcess | None = None

    def Process(self, *args: Any, **kwargs: Any) -> SpawnProcess:  # type: ignore[override]  # noqa: N802
        self.end_programs()  # kills programs of the previous process
        self.newest = MarkedProcess(*args, **kwargs)
        return self.newest

    def end_programs(self) -> None:
        """Kill all programs that the last process started in other groups."""
        if self.newest is not None:
            kill_marked(self.newest.mark)


class Worker:
    """A process that is replaced after a crash or hang; for use by one thread."""

    def __init__(
        self,
        closing: "Future[None]",
        time_limit_s: float,
        calls_per_process: int | None,
        folders: Sequence[str] = (),
    ) -> None:
        self._closing, self._folders = closing, folders
        self._time_limit_s, self._calls_per_process = time_limit_s, calls_per_process
        self._answered = 0
        self._spawn = _Spawn()
        self._pool: Any = None
        self._leader: Future[int] | None = None  # process id, once the process is ready

    def start(self) -> None:
        """Start a process without waiting for it; raise an OSError or a RuntimeError on failure."""
        self._answered = 0
        if self._pool is None or not self._pool.active:
            self.stop()
            SWEEPER.acquire()
            self._pool = ProcessPool(1, context=self._spawn)
        self._leader = self._pool.schedule(prepare, (self._folders,))

    def answer(self, call: Call) -> Answer:
        """Return the answer of ``run_call``; raise NoAnswerError if the process crashed or hung."""
        if self._answered == self._calls_per_process:
            self.stop()
        try:
            self._await_start()
            answer = self._attempt(call, ())
            if answer.kind == MISSING:
                answer = self._attempt(call, call.shared)
        except NoAnswerError:
            self._kill_group()  # Pebble has replaced the process, or its pool is broken
            raise
        self._answered += 1
        return answer

    def stop(self) -> None:
        """Kill the process and its children."""
        if self._pool is None:
            return
        self._pool.stop()
        self._kill_group()
        if self._spawn.newest is not None and self._spawn.newest.pid is not None:
            # A starting process prints errors when join() removes its locks, so it is killed first.
            self._spawn.newest.kill()
            self._spawn.newest.join()
        self._pool.join()
        self._pool = None
        self._spawn.end_programs()
        SWEEPER.release()

    def _kill_group(self) -> None:
        if self._leader is not None and self._leader.done() and not self._leader.exception():
            with suppress(ProcessLookupError, PermissionError):  # the group has no processes left
                os.killpg(self._leader.result(), signal.SIGKILL)
        self._leader = None

    def _await_start(self) -> None:
        try:
            if self._leader is None:
                self.start()
            assert self._leader is not None
            self._result(self._leader, START_LIMIT_S)
        except (OSError, RuntimeError) as error:  # includes TimeoutError, a subclass of OSError
            self.stop()
            raise NoAnswerError(
                "its worker process exited or hung while starting",
                "read the output of that process; a script must run evoros under if __name__ == "
                "'__main__'",
            ) from error

    def _attempt(self, call: Call, contents: Sequence[Shared]) -> Answer:
        limit, process = self._time_limit_s, self._spawn.newest
        try:
            attempt = self._pool.schedule(run_call, (call.payload, contents))
            answer: Answer = self._result(attempt, limit)
            return answer
        except TimeoutError as error:
            raise NoAnswerError(
                f"it ran longer than executor.time_limit_s = {limit:g} s",
                "raise that limit, or use executor=serial to find where the call hangs",
            ) from error
        except ProcessExpired as error:
            raise _crash(error.exitcode) from error
        except RuntimeError as error:  # Pebble's pool broke before the process was replaced
            raise _crash(_await_exit(process)) from error

    def _result(self, attempt: "Future[Any]", limit: float) -> Any:
        """Wait for an attempt by the monotonic clock; Pebble uses the wall clock, which may jump.

        Raises:
            TimeoutError: the process took longer than ``limit`` [s] and was killed.
            NoAnswerError: the process ended with exit code 0, a regular end for Pebble.
            CancelledError: the pool is being closed.
        """
        process, ends = self._spawn.newest, time.monotonic() + limit
        awaited = (attempt, self._closing)
        while not wait(awaited, _until(ends), FIRST_COMPLETED).done:
            if time.monotonic() >= ends:
                self.stop()
                raise TimeoutError
            regular = process is not None and process.exitcode == 0
            if regular and not wait(awaited, LOOK_S, FIRST_COMPLETED).done:
                self.stop()
                raise _crash(0)
        if self._closing.done():
            raise CancelledError
        return attempt.result(timeout=0)


def _until(ends: float) -> float:
    """Return the time [s] to the next check, which is not after ``ends``."""
    return max(0.0, min(LOOK_S, ends - time.monotonic()))


def _await_exit(process: SpawnProcess | None) -> int | None:
    if process is None:
        return None
    process.join(EXIT_S)
    return process.exitcode


def _crash(code: int | None) -> NoAnswerError:
    how = "" if code is None else f" with exit code {code}"
    if code is not None and code < 0:
        how = f" by signal {-code} ({signal.strsignal(-code)})"
    return NoAnswerError(
        f"its worker process ended{how}",
        "read the output of that process, use fewer executor.workers if memory ran out, or debug "
        "with executor=serial",
    )


@dataclass(frozen=True, kw_only=True)
@checked
class Limits:
    """Limits on calls, common to all executors with worker processes."""

    time_limit_s: Annotated[float, POSITIVE] = 600.0  # wall-clock time of one attempt
    retries: Annotated[int, WHOLE] = 1  # further attempts after a crash, hang or PilotLost
    calls_per_worker: Annotated[int | None, null_or_whole(1)] = None  # calls per process; None: all

    def attempt(self, call: Call, worker: Worker) -> Answer:
        """Try a call until there is an answer or no retry is left."""
        attempts = self.retries + 1
        for _ in range(attempts):
            try:
                answer = worker.answer(call)
            except NoAnswerError as error:
                times = "once" if attempts == 1 else f"{attempts} times, the last time"
                lost = f"{call.name}: lost {times} because {error.reason}; {error.fix}"
                answer = Answer(RAISED, pickle.dumps(WorkerLost(lost)))
            else:
                if answer.kind != PILOT_LOST:
                    break
        return answer


def settle(future: "Future[Any]", answer: Answer) -> None:
    """Set the result or the exception of a future."""
    try:
        value = pickle.loads(answer.content)
    except BaseException as error:  # passed to the caller; the thread must continue
        future.set_exception(error)
        return
    if answer.kind == RETURNED:
        future.set_result(value)
    else:
        future.set_exception(value)
