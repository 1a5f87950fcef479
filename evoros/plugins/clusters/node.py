"""Code that runs in a cluster worker, and the environment that all workers must share.

Child processes of ``companion`` run calls, as Dask workers cannot have children.
"""

import hashlib
import math
import os
import pickle
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from multiprocessing.connection import Connection
from tempfile import TemporaryDirectory

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.errors import WorkerLost
from evoros.base.rng import generator
from evoros.executor.protocol import ONE_THREAD, RAISED, Answer
from evoros.files.resources import PACKAGE
from evoros.plugins.clusters.companion import Stop

ENGINES = ("mujoco-core", "pybullet")  # optional packages whose versions must match on both sides
ARITHMETIC, LIBRARY = "arithmetic", "C library"
SAMPLES = 256  # number of points at which elementary functions are compared
UNARY = (
    *(elementary.sin, elementary.cos, elementary.tan, elementary.atan, elementary.tanh),
    *(elementary.exp, elementary.expm1, elementary.sinh, elementary.cosh),
    *(elementary.log, elementary.log1p, elementary.log2, elementary.log10),
)
_INVERSE = (elementary.asin, elementary.acos)  # functions compared on [0, 1]
BINARY = (elementary.atan2, elementary.hypot, elementary.power)
_DEVIATES = 10_000  # enough to reach the tails: 1 in 4000 normal and 1 in 2200 exponential deviates
_LIBRARY_SAMPLES = 20_000  # many, because few values differ between the C libraries of processors
REFUSED = -1  # kind of answer that states why this worker is unsuitable
ATTEMPTS = 2  # maximum number of attempts at a call when the companion is killed
END_S = 1.0  # time limit [s] for a companion to exit after its connections close
SCRIPT = (
    "import sys; sys.path[:] = {path!r}; from evoros.plugins.clusters.companion import main; "
    "main({control}, {folder!r})"
)


def answer(wanted: Mapping[str, str], request: bytes) -> tuple[int, bytes, bool]:
    """Run a pickled ``Request``; return the answer's kind and bytes, and True if C libraries match.

    Arguments and results have built-in types only, so different versions of evoros can exchange
    them.
    """
    differences = list_differences(wanted)
    if differences:
        return REFUSED, f"on {socket.gethostname()} {', '.join(differences)}".encode(), True
    return (*_NODE.ask(request), has_library(wanted))


def stop(pool: str) -> None:
    """End all calls of a pool and their processes."""
    _NODE.stop(pool)


class _Companion:
    def __init__(self) -> None:
        self._folder = TemporaryDirectory(prefix="evoros-modules-", ignore_cleanup_errors=True)
        self._control, control = socket.socketpair()
        script = SCRIPT.format(path=sys.path, control=control.fileno(), folder=self._folder.name)
        with control:
            self.process = subprocess.Popen(
                [sys.executable, "-c", script],
                env={**os.environ, **dict.fromkeys(ONE_THREAD, "1")},
                stdin=subprocess.PIPE,  # closed when this process ends
                pass_fds=(control.fileno(),),
                process_group=0,  # Ctrl-C in a terminal then interrupts only the worker
            )

    def runs(self) -> bool:
        return self.process.poll() is None

    def connect(self) -> Connection:
        ours, theirs = socket.socketpair()
        with theirs:
            socket.send_fds(self._control, [b"."], [theirs.fileno()])
        return Connection(ours.detach())


class _Node:
    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._companion: _Companion | None = None
        self._thread = threading.local()  # holds the companion and connection of each thread

    def ask(self, request: bytes) -> Answer:
        for _ in range(ATTEMPTS):
            try:
                connection = self._connect()
                connection.send_bytes(request)
                answer: Answer = connection.recv()
                return answer
            except (EOFError, OSError) as error:
                reason = error
                if self._companion is not None:
                    with suppress(subprocess.TimeoutExpired):
                        self._companion.process.wait(END_S)
                self._thread.companion = None
        name = pickle.loads(request).name
        lost = WorkerLost(
            f"{name}: lost {ATTEMPTS} times, because the companion process of the cluster worker "
            f"exited ({type(reason).__name__}); read the worker's output, and give the worker "
            "more memory if memory ran out"
        )
        return Answer(RAISED, pickle.dumps(lost))

    def stop(self, pool: str) -> None:
        if self._companion is not None and self._companion.runs():
            connection = self._connect()
            connection.send(Stop(pool))
            connection.recv()

    def _connect(self) -> Connection:
        with self._lock:
            if self._companion is None or not self._companion.runs():
                self._companion = _Companion()
            companion = self._companion
        if getattr(self._thread, "companion", None) is not companion:  # unset, or replaced
            self._thread.companion, self._thread.connection = companion, companion.connect()
        connection: Connection = self._thread.connection
        return connection


_NODE = _Node()


@cache
def describe_environment() -> Mapping[str, str]:
    """Return the versions and digests of all software and arithmetic that affect results.

    ``ARITHMETIC`` and ``LIBRARY`` are digests of values of the functions of evoros and of the C
    library.
    """
    software = {
        "python": ".".join(map(str, sys.version_info[:2])),
        "evoros": f"of sources {_digest_of_sources()}",
        "numpy": np.__version__,
        "numba": _version("numba"),
        ARITHMETIC: _digest_of_elementary(),
        LIBRARY: _digest_of_library(),
    }
    return software | {name: _version(name) for name in ENGINES}


def list_differences(wanted: Mapping[str, str]) -> list[str]:
    """Describe how this process differs from the main process, ignoring the C library."""
    here = describe_environment()
    return [
        f"{name} {here.get(name) or '(not installed)'}, not {value}"
        for name, value in wanted.items()
        if name != LIBRARY
        and here.get(name, "") != value
        and not (name in ENGINES and not (here.get(name) and value))
    ]


def has_library(wanted: Mapping[str, str]) -> bool:
    """Return True if the C library here computes the same values as in the main process."""
    return describe_environment()[LIBRARY] == wanted.get(LIBRARY)


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def _digest_of_sources() -> str:
    """Return a digest of the package's source files, without folders that only a checkout has."""
    digest = hashlib.sha256()
    for file in sorted(PACKAGE.rglob("*.py")):
        name = file.relative_to(PACKAGE)
        if name.parts[0] not in ("analysis", "conf") and "tests" not in name.parts:
            content = file.read_bytes()
            digest.update(f"{name.as_posix()}:{len(content)}:".encode() + content)
    return digest.hexdigest()[:8]


def _digest_of_elementary() -> str:
    """Return a digest of values from evoros's elementary functions, equal on every processor."""
    points = _points(SAMPLES)
    values = [np.array([function(x) for x in points.tolist()]) for function in UNARY]
    values += [np.array([function(x) for x in (points / 21.0).tolist()]) for function in _INVERSE]
    pairs = list(zip(points.tolist(), points[::-1].tolist(), strict=True))
    values += [np.array([function(x, y) for x, y in pairs]) for function in BINARY]
    return _digest([*values, *draw_deviates()])


def draw_deviates() -> tuple[Array, Array]:
    """Draw normal and exponential deviates, including some from the tails."""
    rng = generator("environment", "deviates")
    return rng.standard_normal(_DEVIATES), rng.standard_exponential(_DEVIATES)


def _digest_of_library() -> str:
    """Return a digest of values from C library functions, which physics engines call."""
    points = _points(_LIBRARY_SAMPLES).tolist()
    functions = (math.sin, math.cos, math.tan, math.atan, math.exp, math.log)
    return _digest([np.array([function(x) for x in points]) for function in functions])


def _points(count: int) -> Array:
    return (np.arange(1.0, count + 1.0) * 0.7390851332151607) % 20.0 + 1e-3


def _digest(values: Sequence[Array]) -> str:
    return hashlib.sha256(np.concatenate(values).astype("<f8").tobytes()).hexdigest()[:8]
