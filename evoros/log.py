"""Where messages go: to the terminal for the commands, into the folder for every run."""

import logging
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

LOGGER = logging.getLogger("evoros")


@contextmanager
def logging_to_terminal() -> Iterator[None]:
    """Messages go to standard error; results alone go to standard output."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setLevel(logging.INFO)
    handler.setFormatter(logging.Formatter("%(message)s"))
    LOGGER.addHandler(handler)
    LOGGER.propagate = False
    try:
        yield
    finally:
        LOGGER.removeHandler(handler)
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
    LOGGER.addHandler(memory)
    try:
        yield memory.records
    finally:
        LOGGER.removeHandler(memory)


@contextmanager
def logging_to_file(path: Path, before: Sequence[logging.LogRecord] = ()) -> Iterator[None]:
    """Messages go into the file, too, and tracebacks go there alone.

    ``before`` are messages that were said before the file was there.
    """
    handler = logging.FileHandler(path)
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    for record in before:
        handler.handle(record)
    level = LOGGER.level
    LOGGER.addHandler(handler)
    LOGGER.setLevel(logging.DEBUG)
    try:
        yield
    finally:
        LOGGER.removeHandler(handler)
        LOGGER.setLevel(level)
        handler.close()
