"""The process beside a worker of a cluster, whose children run the calls that the worker gets.

It has one thread for each thread of the worker, with one process for its calls. A call that
crashes or hangs costs that process and not the worker, and is tried again on the spot, as in
``Processes``.
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

from evoros.executor.attempts import Limits
from evoros.executor.modules import unpack_modules
from evoros.executor.payload import MISSING, RAISED, Answer, Call, Kept, MissingError, Shared
from evoros.executor.worker_handle import Worker
from evoros.executor.worker_main import end_with

CLOSED_POOLS = 16
"""Closed pools that are remembered."""


@dataclass(frozen=True)
class Request:
    """A call as it travels to a worker of a cluster, with the shared contents that it lacked."""

    pool: str
    limits: Limits
    modules: bytes | None  # digest of the archive of the user's modules
    name: str
    payload: bytes
    digests: tuple[bytes, ...]
    contents: tuple[Shared, ...] = ()


@dataclass(frozen=True)
class Stop:
    """Ends all calls of a pool, and their processes."""

    pool: str


@dataclass
class _Slot:
    """The process of one thread; it serves one pool, with one state of the user's modules."""

    key: tuple[str, bytes | None]
    worker: Worker
    closing: "Future[None]"
    busy: threading.Lock = field(default_factory=threading.Lock)

    def end(self) -> None:
        """End the process, and the call in it if there is one."""
        with suppress(Exception):  # it has been set by another thread
            self.closing.set_result(None)
        with self.busy:
            self.worker.stop()


class Companion:
    """Runs the calls of all threads of a worker; unpacks modules into ``folder``."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._kept = Kept()
        self._lock = threading.Lock()
        self._slots: dict[int, _Slot] = {}  # by thread
        self._closed: list[str] = []
        self._unpacked: dict[bytes, list[str]] = {}  # folders by digest of the archive

    def serve(self, connection: Connection) -> None:
        """Answer the messages of a thread of the worker, to its end."""
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
    """Serve the threads of the worker, each by a socket that comes through the socket ``control``.

    The standard input is a pipe whose other end only the worker holds. This process leads a group.
    """
    end_with(sys.stdin.fileno())
    companion = Companion(Path(folder))
    with socket.socket(fileno=control) as threads:
        while sockets := socket.recv_fds(threads, 1, 1)[1]:
            os.set_inheritable(sockets[0], False)
            connection = Connection(sockets[0])
            threading.Thread(target=companion.serve, args=(connection,), daemon=True).start()
