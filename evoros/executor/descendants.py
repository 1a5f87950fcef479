"""Kills all programs started by a worker's calls, even those in other sessions.

Programs inherit a mark in their environment, even outside the worker's process group. When the
worker ends, all programs with the mark are killed. If the main process is killed, a separate
process, the sweeper, kills them. Marks are read from ``/proc``, so this works on Linux only. The
sweeper runs this file without site-packages, so only the standard library is imported.
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

VARIABLE = "EVOROS_WORKER"  # environment variable with the marks of a process and of its ancestors
MAIN = uuid4().hex  # common prefix of the worker marks of this process
ROUNDS = 100  # maximum number of searches, because a program may start others before it is killed

_NUMBERS = count()
_ENVIRONMENT = Lock()  # held while a worker starts, because the environment is shared


class MarkedProcess(SpawnProcess):
    """A worker process with a mark in its environment, by which its descendants are found."""

    def __init__(self, *args: object, **kwargs: object) -> None:
        super().__init__(*args, **kwargs)  # type: ignore[arg-type]
        self.mark = f"{MAIN}-{next(_NUMBERS)};"

    def start(self) -> None:
        """Start the process with the mark in its environment."""
        with _ENVIRONMENT:
            before = os.environ.get(VARIABLE, "")
            os.environ[VARIABLE] = before + self.mark
            try:
                super().start()
            finally:
                del os.environ[VARIABLE]
                os.environ.update({VARIABLE: before} if before else {})


def kill_marked(mark: str) -> None:
    """Kill all other processes with the mark in their environment."""
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
    except OSError:  # the process has exited, or belongs to another user
        return False
    return f"{VARIABLE}=".encode() in environment and mark.encode() in environment


class Sweeper:
    """Kills the processes marked ``MAIN`` if this process ends before ``release``."""

    def __init__(self) -> None:
        self._lock, self._users = Lock(), 0
        self._process: subprocess.Popen[bytes] | None = None

    def acquire(self) -> None:
        """Start the sweeper process if this is the first user."""
        with self._lock:
            self._users += 1
            if self._users == 1 and sys.platform == "linux":
                # The sweeper ignores signals from the terminal in a new session.
                command = [sys.executable, "-I", "-S", __file__, MAIN]
                self._process = subprocess.Popen(
                    command, stdin=subprocess.PIPE, start_new_session=True
                )

    def release(self) -> None:
        """Stop the sweeper process if this was the last user."""
        with self._lock:
            self._users -= 1
            if self._users == 0 and self._process is not None:
                self._process.communicate(b"released")
                self._process = None


SWEEPER = Sweeper()

if __name__ == "__main__":
    if not sys.stdin.buffer.read():
        kill_marked(sys.argv[1])
