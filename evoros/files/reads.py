"""Records all files that a piece of code reads, including those in libraries."""

import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

_READ = "evoros.read"  # audit event for a file that another process has read on behalf of this one
_WRITING = os.O_WRONLY | os.O_RDWR
_COLLECTORS: list[set[Path]] = []


@contextmanager
def collect_reads() -> Iterator[set[Path]]:
    """Collect the full paths of all files that are opened for reading within the context."""
    _install()
    paths: set[Path] = set()
    _COLLECTORS.append(paths)
    try:
        yield paths
    finally:
        _COLLECTORS.remove(paths)


def note_read(paths: Iterable[str]) -> None:
    """Report files that another process has read."""
    for path in paths:
        sys.audit(_READ, path, "r", 0)


@cache
def _install() -> None:
    """Install the audit hook permanently; it does nothing outside ``collect_reads``."""
    sys.addaudithook(_note)


def _note(event: str, arguments: tuple[Any, ...]) -> None:
    if not _COLLECTORS or event not in ("open", _READ):
        return
    name, mode, flags = arguments
    if isinstance(mode, str):
        writes = any(letter in mode for letter in "wax+")
    else:
        writes = isinstance(flags, int) and bool(flags & _WRITING)
    if isinstance(name, str | bytes | os.PathLike) and not writes:
        path = Path(os.path.abspath(os.fsdecode(name)))
        for paths in _COLLECTORS:
            paths.add(path)
