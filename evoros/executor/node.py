"""The code that runs inside a worker of a cluster: it has a process of its own run each call.

A call that crashes or hangs therefore costs that process and not the worker of the cluster, and is
tried again on the spot, as ``Processes`` does it. Each thread of the worker has one process.
"""

import atexit
import multiprocessing.process
import os
import pickle
import shutil
import socket
import sys
import tempfile
import threading
from collections.abc import Mapping
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from evoros.base.threads import ONE_THREAD
from evoros.executor.attempts import Limits
from evoros.executor.environment import has_library, list_differences
from evoros.executor.modules import unpack_modules
from evoros.executor.payload import MISSING, RAISED, Answer, Call, Kept, MissingError, Shared
from evoros.executor.worker_handle import Worker

REFUSED = -1
"""The kind of an answer that lists why this worker does not fit."""
POOLS = 16
"""Closed pools that a worker remembers."""


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


def answer(wanted: Mapping[str, str], request: bytes) -> tuple[int, bytes, bool]:
    """Run the pickled ``Request``.

    Returns kind and content of an answer, and whether the C library is as in the main process.

    A worker with another version of evoros must understand the arguments and be understood, so
    they are of built-in types, and the request is not unpickled where the environment differs.
    """
    differences = list_differences(wanted)
    if differences:
        return REFUSED, f"on {socket.gethostname()} {', '.join(differences)}".encode(), True
    try:
        kind, content = _NODE.answer(pickle.loads(request))
    except CancelledError as error:
        kind, content = RAISED, pickle.dumps(error)
    return kind, content, has_library(wanted)


def stop(pool: str) -> None:
    """End all calls of a pool, and their processes."""
    _NODE.stop(pool)


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


class _Node:
    def __init__(self) -> None:
        self._kept = Kept()
        self._lock = threading.Lock()
        self._slots: dict[int, _Slot] = {}  # by thread
        self._closed: list[str] = []
        self._folders: dict[bytes, list[str]] = {}  # by digest of the archive

    def answer(self, request: Request) -> Answer:
        self._kept.add(request.contents)
        try:
            folders = self._unpack(request.modules)
            shared = tuple(self._kept.get(digest) for digest in request.digests)
        except MissingError:
            return Answer(MISSING)
        slot = self._find_slot(request, folders)
        with slot.busy:
            return request.limits.attempt(Call(request.name, request.payload, shared), slot.worker)

    def stop(self, pool: str) -> None:
        with self._lock:
            self._closed = [*self._closed, pool][-POOLS:]
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
            _make_parent()
            closing: Future[None] = Future()
            worker = request.limits.start_worker(closing, folders)
            self._slots[thread] = _Slot(key, worker, closing)
        if before is not None:
            before.end()
        return self._slots[thread]

    def _unpack(self, digest: bytes | None) -> list[str]:
        if digest is None:
            return []
        content = self._kept.get(digest).content
        with self._lock:
            if digest not in self._folders:
                folder = tempfile.mkdtemp(prefix="evoros-modules-")
                atexit.register(shutil.rmtree, folder, ignore_errors=True)
                self._folders[digest] = unpack_modules(content, Path(folder))
            return self._folders[digest]


_NODE = _Node()


def _make_parent() -> None:
    """Let this process start processes that compute in one thread each."""
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    # Workers of dask are daemons of their nannies, which multiprocessing forbids to have children.
    # It would not end them; these end by themselves when their parent is gone.
    multiprocessing.process.current_process()._config["daemon"] = False  # type: ignore[attr-defined]
    main = sys.modules["__main__"]
    if _is_launcher(main):  # a process would import it for nothing
        main.__spec__ = None
        if hasattr(main, "__file__"):
            del main.__file__


def _is_launcher(main: object) -> bool:
    """Whether the main module is a command of dask or of MPI, and none of the user's."""
    name = getattr(getattr(main, "__spec__", None), "name", None) or ""
    file = Path(getattr(main, "__file__", None) or "")
    package = name.partition(".")[0]
    return package in ("distributed", "mpi4py") or file.name.startswith("dask")
