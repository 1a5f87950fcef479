"""Lines that are the same again: about how a file was read, and warnings of preflight."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

_LOG = logging.getLogger(__name__)
_READERS = ("evoros.sdf", "evoros.xml", "evoros.formats.", "evoros.robot.", "evoros.world.",
            "evoros.drive.", "evoros.files.")  # fmt: skip
"""The loggers of what was left out or assumed when a robot or a world was read."""
_ONCE = (*_READERS, "evoros.preflight.", "evoros.config.")
"""The loggers of lines that are the same for many jobs of a sweep."""


class _Once(logging.Filter):
    """Passes each line of ``_ONCE`` once, and no line of a reader that ``read_again`` withholds.

    All handlers of the terminal share it, because they take turns.
    """

    def __init__(self) -> None:
        super().__init__()
        self.shown: dict[str, logging.LogRecord] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        if not record.name.startswith(_ONCE):
            return True
        known = _KNOWN.get()
        if known is not None and record.name.startswith(_READERS) and known.has(record):
            return False
        # Another handler may have shown the same record elsewhere.
        return self.shown.setdefault(record.getMessage(), record) is record


SHOW_ONCE = _Once()


class _KnownLines:
    """The lines of a log, and the repeated ones of them."""

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
    """Withhold lines about how files are read that ``log`` has, and count them in one line.

    A log that is absent or cannot be read withholds none.
    """
    known = _KnownLines(log)
    token = _KNOWN.set(known)
    try:
        yield
    finally:
        _KNOWN.reset(token)
        if known.repeated:
            count = len(known.repeated)
            lines = "line" if count == 1 else "lines"
            _LOG.warning("%d %s about how files were read are in %s", count, lines, log)
