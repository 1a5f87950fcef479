"""The main process's handle on one worker process.

Each worker has one Pebble pool, which gets one call at a time. In a pool with several processes,
Pebble 5.2 can blame a crash on the wrong call, or give up the whole pool and all calls that wait in
it. It did so in 4 of 24 trials in which calls crashed at their start while the main process was
busy.
"""

import os
import signal
import time
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import suppress
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any

from pebble import ProcessExpired, ProcessPool

from evoros.executor.descendants import SWEEPER, MarkedProcess, kill_marked
from evoros.executor.payload import MISSING, Answer, Call, Shared
from evoros.executor.worker_main import prepare, run_call

START_LIMIT_S = 120.0
"""A process that is not ready by then is killed; all it has to do is import the main script."""
EXIT_S = 10.0
"""Time within which a process that has closed its pipe ends."""
LOOK_S = 1.0
"""Time between two looks at whether the process of a call is still there."""


class NoAnswerError(Exception):
    """An attempt at a call got no answer."""

    def __init__(self, reason: str, fix: str) -> None:
        super().__init__(reason, fix)
        self.reason = reason
        self.fix = fix


class _Spawn(SpawnContext):
    """Spawns as usual and keeps the newest process, which Pebble does not expose."""

    newest: MarkedProcess | None = None

    def Process(self, *args: Any, **kwargs: Any) -> SpawnProcess:  # type: ignore[override]  # noqa: N802
        self.end_programs()  # of the process that is replaced
        self.newest = MarkedProcess(*args, **kwargs)
        return self.newest

    def end_programs(self) -> None:
        """Kill all that the newest process has started and that has left its group."""
        if self.newest is not None:
            kill_marked(self.newest.mark)


class Worker:
    """A process that is replaced when a call crashes it or hangs. Only one thread uses it."""

    def __init__(
        self,
        closing: "Future[None]",
        time_limit_s: float,
        calls_per_process: int | None,
        folders: Sequence[str] = (),
    ) -> None:
        """Start a process at the first call; it imports from ``folders`` first."""
        self._closing, self._folders = closing, folders
        self._time_limit_s, self._calls_per_process = time_limit_s, calls_per_process
        self._answered = 0
        self._spawn = _Spawn()
        self._pool: Any = None
        self._leader: Future[int] | None = None  # its process id, once the process is ready

    def start(self) -> None:
        """Start a process without waiting for it.

        Raises:
            OSError, RuntimeError: the system or Pebble cannot start one.
        """
        self._answered = 0
        if self._pool is None or not self._pool.active:
            self.stop()
            SWEEPER.acquire()
            self._pool = ProcessPool(1, context=self._spawn)
        self._leader = self._pool.schedule(prepare, (self._folders,))

    def answer(self, call: Call) -> Answer:
        """Send the call to the process; returns the answer of ``worker_main.run_call``.

        Raises:
            NoAnswerError: the process crashed or hung.
            CancelledError: the pool is being closed.
        """
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
            # A process that is still starting would complain that join() takes its locks away.
            self._spawn.newest.kill()
            self._spawn.newest.join()
        self._pool.join()
        self._pool = None
        self._spawn.end_programs()
        SWEEPER.release()

    def _kill_group(self) -> None:
        if self._leader is not None and self._leader.done() and not self._leader.exception():
            with suppress(ProcessLookupError, PermissionError):  # the group is empty
                os.killpg(self._leader.result(), signal.SIGKILL)
        self._leader = None

    def _await_start(self) -> None:
        try:
            if self._leader is None:
                self.start()
            assert self._leader is not None
            self._result(self._leader, START_LIMIT_S)
        except (OSError, RuntimeError) as error:  # a TimeoutError is an OSError
            self.stop()
            raise NoAnswerError(
                "its worker process ended or hung as it started",
                "read what that process printed; a script must run evoros under "
                "if __name__ == '__main__'",
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
                "raise that limit, or use executor=serial to find where it hangs",
            ) from error
        except ProcessExpired as error:
            raise _crash(error.exitcode) from error
        except RuntimeError as error:  # Pebble's pool broke before it replaced the process
            raise _crash(_await_exit(process)) from error

    def _result(self, attempt: "Future[Any]", limit: float) -> Any:
        """Wait for the result of an attempt.

        Pebble has limits, too, but by the wall clock, which jumps when it is corrected and after a
        suspend.

        Raises:
            TimeoutError: the process took longer than ``limit`` [s], and was killed.
            NoAnswerError: the process ended with exit code 0, which Pebble takes for a regular end.
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
    """Return the time [s] for the next look at a process whose limit ends at ``ends``."""
    return max(0.0, min(LOOK_S, ends - time.monotonic()))


def _await_exit(process: SpawnProcess | None) -> int | None:
    """Return the exit code of a process that is ending: no message may depend on luck."""
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
        "read what that process printed, take fewer executor.workers if memory ran out, or "
        "debug it with executor=serial",
    )
