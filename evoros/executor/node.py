"""The code that runs inside a worker of a cluster: it hands each call to the process beside it.

multiprocessing allows a worker of dask no children, because its nanny has made it a daemon, and
would import the main module of the worker, a command of dask or MPI, in each of them. So calls run
in children of the program ``companion``.
"""

import os
import pickle
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping
from contextlib import suppress
from multiprocessing.connection import Connection
from tempfile import TemporaryDirectory

from evoros.base.errors import WorkerLost
from evoros.executor.companion import Stop
from evoros.executor.environment import has_library, list_differences
from evoros.executor.payload import RAISED, Answer
from evoros.executor.threads import ONE_THREAD

REFUSED = -1
"""The kind of an answer that lists why this worker does not fit."""
ATTEMPTS = 2
"""At a call whose companion ends, as none does by itself."""
END_S = 1.0
"""Between the end of a companion's connections and the end of the companion [s]."""
SCRIPT = (
    "import sys; sys.path[:] = {path!r}; from evoros.executor.companion import main; "
    "main({control}, {folder!r})"
)


def answer(wanted: Mapping[str, str], request: bytes) -> tuple[int, bytes, bool]:
    """Run the pickled ``Request``.

    Returns kind and content of an answer, and whether the C library is as in the main process.

    A worker with another version of evoros must understand the arguments and be understood, so
    they are of built-in types, and the request is not unpickled where the environment differs.
    """
    differences = list_differences(wanted)
    if differences:
        return REFUSED, f"on {socket.gethostname()} {', '.join(differences)}".encode(), True
    return (*_NODE.ask(request), has_library(wanted))


def stop(pool: str) -> None:
    """End all calls of a pool, and their processes."""
    _NODE.stop(pool)


class _Companion:
    """The process beside this one, which ends with it, whatever the two do."""

    def __init__(self) -> None:
        self._folder = TemporaryDirectory(prefix="evoros-modules-", ignore_cleanup_errors=True)
        self._control, control = socket.socketpair()
        script = SCRIPT.format(path=sys.path, control=control.fileno(), folder=self._folder.name)
        with control:
            self._process = subprocess.Popen(
                [sys.executable, "-c", script],
                env={**os.environ, **dict.fromkeys(ONE_THREAD, "1")},
                stdin=subprocess.PIPE,  # never written to: it tells when this process is gone
                pass_fds=(control.fileno(),),
                process_group=0,  # so that Ctrl-C in a terminal reaches the worker alone
            )

    def runs(self) -> bool:
        return self._process.poll() is None

    def await_end(self) -> None:
        """Wait for its end after it has closed a connection."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(END_S)

    def connect(self) -> Connection:
        """Return a connection to a new thread in the companion."""
        ours, theirs = socket.socketpair()
        with theirs:
            socket.send_fds(self._control, [b"."], [theirs.fileno()])
        return Connection(ours.detach())


class _Node:
    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._companion: _Companion | None = None
        self._thread = threading.local()  # its companion and the connection to it

    def ask(self, request: bytes) -> Answer:
        """Return the answer of the companion, which another one replaces if it was killed."""
        for _ in range(ATTEMPTS):
            try:
                connection = self._connect()
                connection.send_bytes(request)
                answer: Answer = connection.recv()
                return answer
            except (EOFError, OSError) as error:
                reason = error
                if self._companion is not None:
                    self._companion.await_end()
                self._thread.companion = None
        name = pickle.loads(request).name
        lost = WorkerLost(
            f"{name}: lost {ATTEMPTS} times because the process of evoros beside the worker of the "
            f"cluster ended ({type(reason).__name__}); read what the worker printed, and give it "
            f"more memory if its machine ran out"
        )
        return Answer(RAISED, pickle.dumps(lost))

    def stop(self, pool: str) -> None:
        if self._companion is not None and self._companion.runs():
            connection = self._connect()
            connection.send(Stop(pool))
            connection.recv()

    def _connect(self) -> Connection:
        """Return the connection of this thread."""
        with self._lock:
            if self._companion is None or not self._companion.runs():
                self._companion = _Companion()
            companion = self._companion
        if getattr(self._thread, "companion", None) is not companion:  # the first time, or it ended
            self._thread.companion, self._thread.connection = companion, companion.connect()
        connection: Connection = self._thread.connection
        return connection


_NODE = _Node()
