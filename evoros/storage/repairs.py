"""Repairs of a folder: files that were lost or damaged, and are made anew."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Repair:
    """A file that is made anew; it was missing unless a field tells of another problem."""

    path: Path
    where: str = ""  # the damaged lines, as ": line 3, 7", if they are known
    kept: Path | None = None  # a copy of what was damaged
    problem: str = ""  # what it was, if it was neither missing nor damaged


Report = Callable[[Repair], object]
"""Receives each repair when it is made."""


def ignore(repair: Repair) -> None:
    """Report nothing."""
