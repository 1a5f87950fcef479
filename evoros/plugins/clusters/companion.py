"""A companion process of a cluster worker; child processes of the companion run the calls.

There is one child per thread, so a call that crashes or hangs costs only that child. Without the
companion, Dask's nanny (distributed 2026.8.0) would restart the whole worker.
"""

import importlib.machinery
import io
import os
import pickle
import socket
import sys
import sysconfig
import tempfile
import threading
import zipfile
from collections.abc import Iterator
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Lock

from evoros.base.errors import InputError
from evoros.executor.protocol import MISSING, RAISED, Answer, Call, Kept, MissingError, Shared
from evoros.executor.worker_handle import Limits, Worker
from evoros.executor.worker_main import end_with

MAX_BYTES = 64 * 2**20  # maximum total size of the modules; a larger folder holds more than code
_OURS = ("evoros", "__main__")
_EPOCH = (1980, 1, 1, 0, 0, 0)


class UserModules:
    """The user's modules imported in this process, with the files next to them, each read once."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._known = 0  # number of imported modules at the time of the last archive
        self._files: dict[str, bytes] = {}  # keyed by name in the archive
        self._folders: list[Path] = []
        self._archive: Shared | None = None

    def pack(self) -> Shared | None:
        """Return an archive of all modules imported so far; None if there are none."""
        with self._lock:
            if len(sys.modules) != self._known:
                self._known = len(sys.modules)
                before = len(self._files)
                self._add_new()
                if len(self._files) != before:
                    self._archive = self._write()
            return self._archive

    def _add_new(self) -> None:
        for folder, file in sorted(set(_list_files())):
            if folder not in self._folders:
                self._folders.append(folder)
            name = f"{self._folders.index(folder)}/{file.relative_to(folder).as_posix()}"
            if name in self._files:
                continue
            try:
                self._files[name] = file.read_bytes()
            except OSError as error:
                raise InputError(
                    f"{file}: cannot be read to be sent to workers ({error.strerror}); "
                    f"change the file's permissions, or move the file out of {folder}"
                ) from error
            if sum(map(len, self._files.values())) > MAX_BYTES:
                raise InputError(
                    f"{folder}: the modules sent to workers exceed {MAX_BYTES >> 20} MiB with "
                    f"{file}; move your modules into a separate folder"
                )

    def _write(self) -> Shared:
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in sorted(self._files.items()):
                archive.writestr(zipfile.ZipInfo(name, _EPOCH), content)
        return Shared.of(buffer.getvalue())


def unpack_modules(archive: bytes, folder: Path) -> list[str]:
    """Unpack an archive into an empty folder, and return the folders to add to sys.path."""
    with zipfile.ZipFile(io.BytesIO(archive)) as packed:
        packed.extractall(folder)
    return [str(path) for path in sorted(folder.iterdir(), key=lambda path: int(path.name))]


def _list_files() -> Iterator[tuple[Path, Path]]:
    """Yield each file to send, with the folder on ``sys.path`` from which it is imported."""
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        top = name.partition(".")[0]
        if file is None or top in _OURS or _is_installed(Path(file)):
            continue
        source = Path(file).resolve()
        for entry in sys.path:
            folder = Path(entry or ".").resolve()
            place = folder / name.replace(".", "/")
            if source not in (place.with_suffix(".py"), place / "__init__.py"):
                continue
            if source == place.with_suffix(".py"):  # modules next to it may be imported later
                near = (path for path in folder.glob("*.py") if path.is_file())
                yield from ((folder, p) for p in near if p.stem not in sys.stdlib_module_names)
            if (folder / top).is_dir():
                yield from ((folder, path) for path in _list_package(folder / top))
            break


def _list_package(folder: Path) -> Iterator[Path]:
    for path in folder.iterdir():
        if path.name.startswith(".") or path.name == "__pycache__":
            continue
        if path.is_dir() and not path.is_symlink():
            yield from _list_package(path)
        elif path.is_file():
            yield path


def _is_installed(file: Path) -> bool:
    if file.suffix not in importlib.machinery.SOURCE_SUFFIXES:
        return True
    if {"site-packages", "dist-packages"} & set(file.parts):
        return True
    return any(file.is_relative_to(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib"))


CLOSED_POOLS = 16  # number of closed pools to remember


@dataclass(frozen=True)
class Request:
    """A call sent to a cluster worker, with shared arguments that the worker lacks."""

    pool: str
    limits: Limits
    modules: bytes | None  # digest of the archive with the user's modules
    name: str
    payload: bytes
    digests: tuple[bytes, ...]
    contents: tuple[Shared, ...] = ()


@dataclass(frozen=True)
class Stop:
    """A request to end a pool's calls and their processes."""

    pool: str


@dataclass
class _Slot:
    key: tuple[str, bytes | None]
    worker: Worker
    closing: "Future[None]"
    busy: threading.Lock = field(default_factory=threading.Lock)

    def end(self) -> None:
        with suppress(Exception):  # another thread may have set the result already
            self.closing.set_result(None)
        with self.busy:
            self.worker.stop()


class Companion:
    """Runs the calls of a worker's threads, and unpacks modules into ``folder``."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._kept = Kept()
        self._lock = threading.Lock()
        self._slots: dict[int, _Slot] = {}  # keyed by thread
        self._closed: list[str] = []
        self._unpacked: dict[bytes, list[str]] = {}  # unpacked folders, by digest of the archive

    def serve(self, connection: Connection) -> None:
        """Answer the messages of one worker thread until the thread ends."""
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
        except (CancelledError, OSError) as error:  # OSError: modules cannot be unpacked
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
            slot = self._slots[thread] = _Slot(key, worker, closing)
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
    """Serve the worker's threads, whose sockets arrive through ``control``, until stdin closes."""
    end_with(sys.stdin.fileno())
    companion = Companion(Path(folder))
    with socket.socket(fileno=control) as threads:
        while sockets := socket.recv_fds(threads, 1, 1)[1]:
            os.set_inheritable(sockets[0], False)
            connection = Connection(sockets[0])
            threading.Thread(target=companion.serve, args=(connection,), daemon=True).start()
