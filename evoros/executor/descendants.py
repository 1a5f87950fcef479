"""Kill all programs that a worker's calls have started, even in other sessions.

Programs inherit a mark in their environment, even outside the worker's process group. All with the
mark are killed when the worker ends, or by a separate process, the sweeper, if the main process is
killed. Marks are read from ``/proc``, which only Linux has. The sweeper runs this file without
site-packages, so it imports the standard library only.
"""

import os
import signal
import subprocess
import sys
from contextlib import suppress
from itertools import count
from multiprocessing.context import SpawnProcess
from pathlib import Path
from threading import Lock
from uuid import uuid4

VARIABLE = "EVOROS_WORKER"  # environment variable with the marks of a process and its ancestors
MAIN = uuid4().hex  # common prefix of the marks of this process's workers
ROUNDS = 100  # maximum number of searches; a program may start another while it is killed

_NUMBERS = count()
_ENVIRONMENT = Lock()  # only one worker is started at a time


class MarkedProcess(SpawnProcess):
    """A worker process that marks its environment, so that its descendants can be found."""

    def __init__(self, *args: object, **kwargs: object) -> None:
        super().__init__(*args, **kwargs)  # type: ignore[arg-type]
        self.mark = f"{MAIN}-{next(_NUMBERS)};"

    def start(self) -> None:
        """Start the process, which inherits the mark."""
        with _ENVIRONMENT:
            before = os.environ.get(VARIABLE, "")
            os.environ[VARIABLE] = before + self.mark
            try:
                super().start()
            finally:
                del os.environ[VARIABLE]
                os.environ.update({VARIABLE: before} if before else {})


def kill_marked(mark: str) -> None:
    """Kill all other processes whose environment has the mark."""
    for _ in range(ROUNDS):
        marked = [int(path.name) for path in Path("/proc").glob("[0-9]*") if _has(path, mark)]
        if not marked:
            return
        for process in marked:
            with suppress(ProcessLookupError, PermissionError):
                os.kill(process, signal.SIGKILL)


def _has(process: Path, mark: str) -> bool:
    if process.name == str(os.getpid()):
        return False
    try:
        environment = (process / "environ").read_bytes()
    except OSError:  # the process has ended, or belongs to another user
        return False
    return f"{VARIABLE}=".encode() in environment and mark.encode() in environment


class Sweeper:
    """Kills the processes marked ``MAIN`` if the current process ends before ``release``."""

    def __init__(self) -> None:
        self._lock, self._users = Lock(), 0
        self._process: subprocess.Popen[bytes] | None = None

    def acquire(self) -> None:
        """Start the sweeper process for its first user."""
        with self._lock:
            self._users += 1
            if self._users == 1 and sys.platform == "linux":
                # A new session keeps terminal signals away from the sweeper.
                command = [sys.executable, "-I", "-S", __file__, MAIN]
                self._process = subprocess.Popen(
                    command, stdin=subprocess.PIPE, start_new_session=True
                )

    def release(self) -> None:
        """End the sweeper process after its last user."""
        with self._lock:
            self._users -= 1
            if self._users == 0 and self._process is not None:
                self._process.communicate(b"released")
                self._process = None


SWEEPER = Sweeper()

if __name__ == "__main__":
    if not sys.stdin.buffer.read():
        kill_marked(sys.argv[1])
