"""The base class of observers, and the frozen records that they receive."""

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TypeAlias

from evoros.base.checks import mapping_of

FREE = ("executor", "observers", "controls", "stop_after")
"""Configuration keys that change only the number of rows. An evaluation has only the first."""
Value: TypeAlias = str | int | float | bool | None
"""A configuration value; lists are strings, and environment references stay unresolved."""


@dataclass(frozen=True)
class ObservedGeneration:
    """A recorded generation."""

    number: int  # starts at 0
    metrics: Mapping[str, float]  # finite metrics of the best candidate, and the mean fitness
    time_s: float  # Unix time of recording


@dataclass(frozen=True)
class ObservedEnd:
    """The latest end of a run, which may yet be resumed or extended."""

    state: str  # finished, stopped or killed
    metrics: Mapping[str, float]  # metrics of the champion on fresh draws, as ``champion.NAME``
    files: Mapping[str, bytes]  # champion and figure files by path in the run folder
    time_s: float

    @cached_property
    def digest(self) -> str:
        """A digest of the state, the metrics and the files that reveals changes."""
        content = hashlib.sha256(repr((self.state, sorted(self.metrics.items()))).encode())
        for name, data in sorted(self.files.items()):
            content.update(f"{name}\0{len(data)}\0".encode() + data)
        return content.hexdigest()


@dataclass(frozen=True)
class ObservedRun:
    """The records of a run so far."""

    id: str  # 32 hexadecimal digits, independent of the folder
    name: str  # folder name
    sweep: str | None  # absolute path of the sweep folder when it was made
    parameters: Mapping[str, Value]  # the configuration by dotted key
    origin: Path  # base folder of a tracker's relative paths
    started_s: float  # Unix time
    generations: Sequence[ObservedGeneration]  # all generations, starting at 0
    end: ObservedEnd | None  # None while the run continues

    @property
    def group(self) -> str | None:
        """The name of the sweep."""
        return None if self.sweep is None else Path(self.sweep).name


Send: TypeAlias = Callable[[ObservedRun], None]
"""Sends new records to the tracker; called again after each new record."""


class Observer(ABC):
    """Sends runs to a tracker. An observer affects no result, and its errors stop no run."""

    def check(self) -> None:  # noqa: B027 - an observer may need nothing
        """Check local requirements, such as a package; raise an InputError if one is missing."""

    @abstractmethod
    def open(self, run: ObservedRun) -> AbstractContextManager[Send]:
        """Connect to the tracker for a run that may already have been sent in part or in full.

        The tracker recognises the run by its ``id``. Leaving the context ends the connection.
        """


OBSERVERS = mapping_of(Observer, "observers (subclasses of evoros.parts.Observer)")
