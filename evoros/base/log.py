"""Where messages go: to the terminal for the commands, into the folder for every run."""

import logging
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path, PurePath
from threading import Lock

LOGGER = logging.getLogger("evoros")

_JOB: ContextVar[str] = ContextVar("job", default="")
"""The folder of the one of several jobs that speaks; empty where there is but one, and for what
concerns all. Two folders may have the same name, in others."""
_LOCK = Lock()


@contextmanager
def on_behalf_of(job: str) -> Iterator[None]:
    """What this thread says meanwhile concerns the job of this folder alone."""
    token = _JOB.set(job)
    try:
        yield
    finally:
        _JOB.reset(token)


@contextmanager
def attached(handler: logging.Handler, own: bool = False) -> Iterator[None]:
    """Messages go to the handler, too; where it is ``own``, those of this thread's job only."""
    job = _JOB.get()
    if own:
        handler.addFilter(lambda record: _JOB.get() == job)
    _attach(handler)
    try:
        yield
    finally:
        _detach(handler)


@contextmanager
def detached(handler: logging.Handler) -> Iterator[None]:
    """No messages go to the handler meanwhile."""
    _detach(handler)
    try:
        yield
    finally:
        _attach(handler)


def _attach(handler: logging.Handler) -> None:
    with _LOCK:  # a new list: another thread may be going through the old one
        LOGGER.handlers = [*LOGGER.handlers, handler]


def _detach(handler: logging.Handler) -> None:
    with _LOCK:
        LOGGER.handlers = [each for each in LOGGER.handlers if each is not handler]


def for_terminal(handler: logging.Handler) -> logging.Handler:
    """Standard error's: of several jobs it has only what went wrong, after the job's name."""
    handler.setLevel(logging.INFO)
    handler.setFormatter(_Named("%(message)s"))
    handler.addFilter(lambda record: not _JOB.get() or record.levelno >= logging.WARNING)
    return handler


class _Named(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        said = super().format(record)
        return f"{PurePath(_JOB.get()).name}: {said}" if _JOB.get() else said


@contextmanager
def logging_to_terminal() -> Iterator[None]:
    """Messages go to standard error; results alone go to standard output."""
    with attached(for_terminal(logging.StreamHandler(sys.stderr))):
        LOGGER.propagate = False
        try:
            yield
        finally:
            LOGGER.propagate = True


class _Memory(logging.Handler):
    """Keeps what is said before there is a file for it."""

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self.records: list[logging.LogRecord] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.records.append(record)


@contextmanager
def remembering() -> Iterator[list[logging.LogRecord]]:
    """The messages that are said while this is open, for ``logging_to_file``."""
    memory = _Memory()
    with attached(memory, own=True):
        yield memory.records


@contextmanager
def logging_to_file(path: Path, before: Sequence[logging.LogRecord] = ()) -> Iterator[None]:
    """Messages go into the file, too, and tracebacks go there alone.

    ``before`` are messages that were said before the file was there.
    """
    handler = logging.FileHandler(path)
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    for record in before:
        handler.handle(record)
    with attached(handler, own=True), logging_all():
        try:
            yield
        finally:
            handler.close()


@contextmanager
def logging_all() -> Iterator[None]:
    """Nothing is too detailed for those handlers that take it.

    Around several jobs, too: each ends with the level that it found.
    """
    level = LOGGER.level
    LOGGER.setLevel(logging.DEBUG)
    try:
        yield
    finally:
        LOGGER.setLevel(level)
