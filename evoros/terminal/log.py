"""The destinations of log messages: the terminal for commands, a file in the folder for runs."""

import logging
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from logging.handlers import BufferingHandler
from pathlib import Path, PurePath
from threading import Lock, get_ident
from typing import TextIO

from evoros.base.errors import InputError
from evoros.terminal.repetition import SHOW_ONCE
from evoros.terminal.unwritable import silence

LOGGER = logging.getLogger("evoros")

_JOB: ContextVar[str] = ContextVar("job", default="")
"""The folder of the job that a message is about; empty for a lone job and for messages about all.

The folder's name would not do: two folders may have the same name in different places.
"""
_LOCK = Lock()
_PROGRESS = "is_progress"  # an attribute of records
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")  # all but tabs and line breaks


def escape_control(text: str) -> str:
    """Spell out control characters, which names and contents of files may have."""
    return _CONTROL.sub(lambda found: ascii(found[0])[1:-1], text)


@contextmanager
def log_for_job(job: str) -> Iterator[None]:
    """Attribute all messages of this thread to the job of this folder."""
    token = _JOB.set(job)
    try:
        yield
    finally:
        _JOB.reset(token)


@contextmanager
def attach(handler: logging.Handler, own_job: bool = False) -> Iterator[None]:
    """Send messages to the handler, too; with ``own_job`` only those about this thread's job."""
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
    """Send no messages to the handler."""
    _remove(handler)
    try:
        yield
    finally:
        _add(handler)


def _add(handler: logging.Handler) -> None:
    with _LOCK:  # a new list: another thread may be going through the old one
        LOGGER.handlers = [*LOGGER.handlers, handler]


def _remove(handler: logging.Handler) -> None:
    with _LOCK:
        LOGGER.handlers = [other for other in LOGGER.handlers if other is not handler]


def format_for_terminal(handler: logging.Handler) -> logging.Handler:
    """Set up a handler for standard error.

    It shows the warnings and errors of the jobs of a sweep, each after the job's name, and all
    messages that concern no job of a sweep. It shows a line about how a file was read, and a
    warning of preflight, only once, although each job of a sweep reads and checks the same.
    """
    handler.setLevel(logging.INFO)
    handler.setFormatter(_JobFormatter("%(message)s"))
    handler.addFilter(lambda record: not _JOB.get() or record.levelno >= logging.WARNING)
    handler.addFilter(SHOW_ONCE)  # last: it takes the lines that it passes for shown
    return handler


class _PlainFormatter(logging.Formatter):
    """Shows control characters, which files and programs of others may have, as ``\\x1b``."""

    def format(self, record: logging.LogRecord) -> str:
        text = super().format(record)
        return escape_control(text)


class _JobFormatter(_PlainFormatter):
    def format(self, record: logging.LogRecord) -> str:
        message = super().format(record)
        return f"{PurePath(_JOB.get()).name}: {message}" if _JOB.get() else message


def log_progress(message: str, *values: object) -> None:
    """Log how far a run has come; a pipe gets the line of progress instead."""
    LOGGER.info(message, *values, extra={_PROGRESS: True})


@cache
def warn_left_out(reason: str) -> None:
    """Warn, once for each reason, that something is left out."""
    LOGGER.warning("%s; left out", reason)


class _StandardError(logging.StreamHandler[TextIO]):
    """Standard error, on which nothing depends: if it cannot be written, it is silenced."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - logging calls it so
        if isinstance(sys.exc_info()[1], OSError):
            silence(self.stream)
        else:
            super().handleError(record)


@contextmanager
def log_to_terminal(*, again: bool = False) -> Iterator[None]:
    """Send messages to standard error; standard output is for results alone.

    ``again`` leaves out lines that this process has shown before; see ``format_for_terminal``.
    A terminal that shows a line of progress takes this over while it does.
    """
    handler = format_for_terminal(_StandardError(sys.stderr))
    handler.addFilter(lambda record: sys.stderr.isatty() or not hasattr(record, _PROGRESS))
    if not again:
        SHOW_ONCE.shown.clear()
    with attach(handler):
        LOGGER.propagate = False
        try:
            yield
        finally:
            LOGGER.propagate = True


@contextmanager
def collect_messages() -> Iterator[list[logging.LogRecord]]:
    """Collect messages of all levels, for ``log_to_file`` once there is a file."""
    memory = BufferingHandler(sys.maxsize)
    with attach(memory, own_job=True), log_everything():
        yield memory.buffer


@contextmanager
def withhold_messages() -> Iterator[list[logging.LogRecord]]:
    """Collect all messages of this thread and show none of them; the innermost collects.

    Handlers filter, because a logger's filters do not see the records of loggers below it.
    """
    memory, thread = BufferingHandler(sys.maxsize), get_ident()
    memory.addFilter(lambda record: record.thread == thread)
    handlers = tuple(LOGGER.handlers)

    def is_of_another(record: logging.LogRecord) -> bool:
        return record.thread != thread

    for handler in handlers:
        handler.addFilter(is_of_another)
    try:
        with attach(memory), log_everything():
            yield memory.buffer
    finally:
        for handler in handlers:
            handler.removeFilter(is_of_another)


class _LogFile(logging.FileHandler):
    """A file that gives up once it cannot be written, and reports it."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - logging calls it so
        error = sys.exc_info()[1]
        self.setLevel(logging.CRITICAL + 1)
        LOGGER.error(
            "%s: cannot be written any more (%s); nothing else depends on it",
            self.baseFilename,
            error.strerror if isinstance(error, OSError) else error,
        )


def _open_file(path: Path) -> logging.Handler:
    try:
        return _LogFile(path)
    except OSError as error:
        raise InputError(
            f"{path}: must be a file that can be written ({error.strerror}); move away what is "
            f"there, or correct its permissions"
        ) from error


@contextmanager
def log_to_file(path: Path, earlier: Sequence[logging.LogRecord] = ()) -> Iterator[None]:
    """Send messages to the file, too; it alone gets tracebacks.

    ``earlier`` are messages from before the file existed; they are written first. If the file
    cannot be written later, as on a full disk, that is reported once.

    Raises:
        InputError: the file cannot be opened.
    """
    handler = _open_file(path)
    handler.setFormatter(_PlainFormatter("%(asctime)s %(levelname)s %(message)s"))
    for record in earlier:
        handler.handle(record)
    with attach(handler, own_job=True), log_everything():
        try:
            yield
        finally:
            with suppress(OSError):  # reported before
                handler.close()


class _Everything:
    """Passes messages of every level to the handlers while at least one holder asks for it.

    Holders may end in any order: jobs of a sweep, and runs in threads.
    """

    def __init__(self) -> None:
        self._holders, self._level = 0, logging.NOTSET

    def acquire(self) -> None:
        with _LOCK:
            if not self._holders:
                self._level = LOGGER.level
                LOGGER.setLevel(logging.DEBUG)
            self._holders += 1

    def release(self) -> None:
        with _LOCK:
            self._holders -= 1
            if not self._holders:
                LOGGER.setLevel(self._level)


_EVERYTHING = _Everything()


@contextmanager
def log_everything() -> Iterator[None]:
    """Pass messages of every level to the handlers, which have levels of their own."""
    _EVERYTHING.acquire()
    try:
        yield
    finally:
        _EVERYTHING.release()
