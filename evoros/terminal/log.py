"""Destinations of log messages: the terminal in commands, a file in run folders."""

import logging
import os
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from logging.handlers import BufferingHandler
from pathlib import Path, PurePath
from threading import Lock, get_ident
from typing import TextIO

from evoros.base.errors import InputError

_LOG = logging.getLogger(__name__)
_READERS = ("evoros.sdf", "evoros.xml", "evoros.formats.", "evoros.robot.", "evoros.world.",
            "evoros.drive.", "evoros.files.")  # fmt: skip
"""Loggers of omissions and assumptions in reading robots and worlds."""
_ONCE = (*_READERS, "evoros.preflight.", "evoros.config.")  # their lines recur in a sweep's jobs
LOGGER = logging.getLogger("evoros")

_JOB: ContextVar[str] = ContextVar("job", default="")  # folder of a sweep's job; empty outside
_LOCK = Lock()
_PROGRESS = "is_progress"  # attribute of log records about progress
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")  # all except tabs and newlines


def escape_control(text: str) -> str:
    """Escape control characters, which file names and contents may contain."""
    return _CONTROL.sub(lambda found: ascii(found[0])[1:-1], text)


@contextmanager
def log_for_job(job: str) -> Iterator[None]:
    """Attribute all messages of this thread to the job in the folder ``job``."""
    token = _JOB.set(job)
    try:
        yield
    finally:
        _JOB.reset(token)


@contextmanager
def attach(handler: logging.Handler, own_job: bool = False) -> Iterator[None]:
    """Add a handler of messages; with ``own_job``, only of messages from this thread's job."""
    job = _JOB.get()
    if own_job:
        handler.addFilter(lambda record: _JOB.get() == job)
    _add(handler)
    try:
        yield
    finally:
        _remove(handler)


@contextmanager
def detach(handler: logging.Handler) -> Iterator[None]:
    """Remove a handler of messages for the context."""
    _remove(handler)
    try:
        yield
    finally:
        _add(handler)


def _add(handler: logging.Handler) -> None:
    with _LOCK:  # a new list, because other threads may iterate over the old one
        LOGGER.handlers = [*LOGGER.handlers, handler]


def _remove(handler: logging.Handler) -> None:
    with _LOCK:
        LOGGER.handlers = [other for other in LOGGER.handlers if other is not handler]


def format_for_terminal(handler: logging.Handler) -> logging.Handler:
    """Configure a handler for standard error."""
    handler.setLevel(logging.INFO)
    handler.setFormatter(_JobFormatter("%(message)s"))
    handler.addFilter(lambda record: not _JOB.get() or record.levelno >= logging.WARNING)
    handler.addFilter(_SHOW_ONCE)  # last, because it remembers the lines that it passes
    return handler


class _PlainFormatter(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        return escape_control(super().format(record))


class _JobFormatter(_PlainFormatter):
    def format(self, record: logging.LogRecord) -> str:
        message = super().format(record)
        return f"{PurePath(_JOB.get()).name}: {message}" if _JOB.get() else message


def log_progress(message: str, *values: object) -> None:
    """Log the progress of a run; on standard error, only if it is a terminal."""
    LOGGER.info(message, *values, extra={_PROGRESS: True})


@cache
def warn_left_out(reason: str) -> None:
    """Warn once per reason that something is left out."""
    LOGGER.warning("%s; left out", reason)


class _StandardError(logging.StreamHandler[TextIO]):
    """A handler for standard error that silences the stream after a failed write."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - logging calls it so
        if isinstance(sys.exc_info()[1], OSError):
            silence(self.stream)
        else:
            super().handleError(record)


@contextmanager
def log_to_terminal(*, again: bool = False) -> Iterator[None]:
    """Send messages to standard error; with ``again``, omit lines that were already shown."""
    handler = format_for_terminal(_StandardError(sys.stderr))
    handler.addFilter(lambda record: sys.stderr.isatty() or not hasattr(record, _PROGRESS))
    if not again:
        _SHOW_ONCE.shown.clear()
    with attach(handler):
        LOGGER.propagate = False
        try:
            yield
        finally:
            LOGGER.propagate = True


@contextmanager
def collect_messages() -> Iterator[list[logging.LogRecord]]:
    """Collect messages of all levels for a later ``log_to_file``."""
    memory = BufferingHandler(sys.maxsize)
    with attach(memory, own_job=True), log_everything():
        yield memory.buffer


@contextmanager
def withhold_messages() -> Iterator[list[logging.LogRecord]]:
    """Collect the messages of this thread without showing them; the innermost context collects."""
    memory, thread = BufferingHandler(sys.maxsize), get_ident()
    memory.addFilter(lambda record: record.thread == thread)
    handlers = tuple(LOGGER.handlers)

    def is_of_another(record: logging.LogRecord) -> bool:
        return record.thread != thread

    # The filters of a logger do not apply to its child loggers.
    for handler in handlers:
        handler.filters.insert(0, is_of_another)  # precedes _SHOW_ONCE, which remembers lines
    try:
        with attach(memory), log_everything():
            yield memory.buffer
    finally:
        for handler in handlers:
            handler.removeFilter(is_of_another)


class _LogFile(logging.FileHandler):
    """A file handler that reports the first failed write and stops writing."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - logging calls it so
        error = sys.exc_info()[1]
        self.setLevel(logging.CRITICAL + 1)
        LOGGER.error(
            "%s: cannot be written (%s); further messages are not logged",
            self.baseFilename,
            error.strerror if isinstance(error, OSError) else error,
        )


@contextmanager
def log_to_file(path: Path, earlier: Sequence[logging.LogRecord] = ()) -> Iterator[None]:
    """Send messages, with tracebacks, to a file, starting with the ``earlier`` ones."""
    try:
        handler = _LogFile(path, encoding="utf-8", errors="backslashreplace")
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written ({error.strerror}); move it away, or change its permissions"
        ) from error
    handler.setFormatter(_PlainFormatter("%(asctime)s %(levelname)s %(message)s"))
    for record in earlier:
        handler.handle(record)
    with attach(handler, own_job=True), log_everything():
        try:
            yield
        finally:
            with suppress(OSError):  # already reported
                handler.close()


class _Everything:
    """Enables messages of all levels until the last of its contexts exits."""

    def __init__(self) -> None:
        self._holders, self._level = 0, logging.NOTSET

    def __enter__(self) -> None:
        with _LOCK:
            if not self._holders:
                self._level = LOGGER.level
                LOGGER.setLevel(logging.DEBUG)
            self._holders += 1

    def __exit__(self, *_: object) -> None:
        with _LOCK:
            self._holders -= 1
            if not self._holders:
                LOGGER.setLevel(self._level)


_EVERYTHING = _Everything()


def log_everything() -> AbstractContextManager[None]:
    """Enable messages of all levels, which each handler filters."""
    return _EVERYTHING


class _Once(logging.Filter):
    """Passes each line of the ``_ONCE`` loggers once, and no lines withheld by ``read_again``."""

    def __init__(self) -> None:
        super().__init__()
        self.shown: dict[str, logging.LogRecord] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        if not record.name.startswith(_ONCE):
            return True
        known = _KNOWN.get()
        if known is not None and record.name.startswith(_READERS) and known.has(record):
            return False
        # The first record with a message may pass repeatedly, once for each handler.
        return self.shown.setdefault(record.getMessage(), record) is record


_SHOW_ONCE = _Once()


class _KnownLines:
    def __init__(self, log: Path) -> None:
        self._text = ""
        with suppress(OSError):
            self._text = log.read_text(encoding="utf-8", errors="replace")
        self.repeated: set[str] = set()

    def has(self, record: logging.LogRecord) -> bool:
        line = f" {record.levelname} {record.getMessage()}\n"
        if line not in self._text:
            return False
        self.repeated.add(line)
        return True


_KNOWN: ContextVar[_KnownLines | None] = ContextVar("known", default=None)


@contextmanager
def read_again(log: Path) -> Iterator[None]:
    """Withhold lines about files that ``log`` already contains, and report their number."""
    known = _KnownLines(log)
    token = _KNOWN.set(known)
    try:
        yield
    finally:
        _KNOWN.reset(token)
        if known.repeated:
            count = len(known.repeated)
            lines = "line" if count == 1 else "lines"
            _LOG.warning("see %s for %d %s about how files were read", log, count, lines)


def silence(stream: TextIO) -> None:
    """Redirect a stream to the null device, also for processes started later."""
    # Otherwise, unwritten data in the buffer would make later flushes fail.
    with suppress(OSError, ValueError):  # the stream has no file descriptor
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)


def silence_unwritable() -> None:
    """Silence the standard streams that cannot be written to."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            silence(stream)
        except ValueError:  # the stream is closed
            pass
