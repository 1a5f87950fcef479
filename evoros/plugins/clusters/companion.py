"""Companion process of a cluster worker; its child processes run the worker's calls.

It has one thread and one child process for each thread of the worker. A call that crashes or hangs
costs only that child process and is retried on the spot, as in ``Processes``. dask's nanny
(distributed 2026.8.0) restarts the whole worker instead, so that a call on its second thread was
run twice.
"""

import os
import pickle
import socket
import sys
import tempfile
import threading
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

from evoros.executor.payload import MISSING, RAISED, Answer, Call, Kept, MissingError, Shared
from evoros.executor.worker_handle import Limits, Worker
from evoros.executor.worker_main import end_with
from evoros.plugins.clusters.modules import unpack_modules

CLOSED_POOLS = 16
"""Number of closed pools that are remembered."""


@dataclass(frozen=True)
class Request:
    """A call as sent to a cluster worker, with the shared contents that the worker lacks."""

    pool: str
    limits: Limits
    modules: bytes | None  # digest of the archive of the user's modules
    name: str
    payload: bytes
    digests: tuple[bytes, ...]
    contents: tuple[Shared, ...] = ()


@dataclass(frozen=True)
class Stop:
    """Request to end all calls of a pool and their processes."""

    pool: str


@dataclass
class _Slot:
    """The process of one thread; it serves one pool and one version of the user's modules."""

    key: tuple[str, bytes | None]
    worker: Worker
    closing: "Future[None]"
    busy: threading.Lock = field(default_factory=threading.Lock)

    def end(self) -> None:
        """End the process and any call in it."""
        with suppress(Exception):  # another thread may have set it
            self.closing.set_result(None)
        with self.busy:
            self.worker.stop()


class Companion:
    """Runner of the calls of all threads of a worker; it unpacks modules into ``folder``."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._kept = Kept()
        self._lock = threading.Lock()
        self._slots: dict[int, _Slot] = {}  # keyed by thread
        self._closed: list[str] = []
        self._unpacked: dict[bytes, list[str]] = {}  # folders keyed by the archive's digest

    def serve(self, connection: Connection) -> None:
        """Answer the messages of a worker's thread until it ends."""
        with suppress(EOFError), connection:
            while True:
                message: Request | Stop = connection.recv()
                if isinstance(message, Stop):
                    self._stop(message.pool)
                    connection.send(None)
                else:
                    connection.send(self._answer(message))
        with self._lock:
            slot = self._slots.pop(threading.get_ident(), None)
        if slot is not None:
            slot.end()

    def _answer(self, request: Request) -> Answer:
        self._kept.add(request.contents)
        try:
            folders = self._unpack(request.modules)
            shared = tuple(self._kept.get(digest) for digest in request.digests)
            slot = self._find_slot(request, folders)
            with slot.busy:
                call = Call(request.name, request.payload, shared)
                return request.limits.attempt(call, slot.worker)
        except MissingError:
            return Answer(MISSING)
        except (CancelledError, OSError) as error:  # an OSError: modules cannot be unpacked
            return Answer(RAISED, pickle.dumps(error))

    def _stop(self, pool: str) -> None:
        with self._lock:
            self._closed = [*self._closed, pool][-CLOSED_POOLS:]
            ended = [slot for slot in self._slots.values() if slot.key[0] == pool]
            self._slots = {t: slot for t, slot in self._slots.items() if slot not in ended}
        for slot in ended:
            slot.end()

    def _find_slot(self, request: Request, folders: list[str]) -> _Slot:
        thread, key = threading.get_ident(), (request.pool, request.modules)
        with self._lock:
            if request.pool in self._closed:
                raise CancelledError
            before = self._slots.get(thread)
            if before is not None and before.key == key:
                return before
            closing: Future[None] = Future()
            limits = request.limits
            worker = Worker(closing, limits.time_limit_s, limits.calls_per_worker, folders)
            slot = _Slot(key, worker, closing)
            self._slots[thread] = slot
        if before is not None:
            before.end()
        return slot

    def _unpack(self, digest: bytes | None) -> list[str]:
        if digest is None:
            return []
        content = self._kept.get(digest).content
        with self._lock:
            if digest not in self._unpacked:
                folder = Path(tempfile.mkdtemp(dir=self._folder))
                self._unpacked[digest] = unpack_modules(content, folder)
            return self._unpacked[digest]


def main(control: int, folder: str) -> None:
    """Serve the worker's threads, whose sockets arrive through the socket ``control``.

    Only the worker holds the other end of standard input, a pipe. This process leads a group.
    """
    end_with(sys.stdin.fileno())
    companion = Companion(Path(folder))
    with socket.socket(fileno=control) as threads:
        while sockets := socket.recv_fds(threads, 1, 1)[1]:
            os.set_inheritable(sockets[0], False)
            connection = Connection(sockets[0])
            threading.Thread(target=companion.serve, args=(connection,), daemon=True).start()
