"""The base class of observers, and the records that observers receive."""

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
"""Configuration keys that do not affect results, only the number of rows (except the first)."""
Value: TypeAlias = str | int | float | bool | None  # lists are strings; references unresolved


@dataclass(frozen=True)
class ObservedGeneration:
    """A recorded generation."""

    number: int  # starts at 0
    metrics: Mapping[str, float]  # finite metrics of the best candidate, and the mean fitness
    time_s: float  # Unix time of recording


@dataclass(frozen=True)
class ObservedEnd:
    """The latest end of a run that may be resumed or extended."""

    state: str  # finished, stopped or killed
    metrics: Mapping[str, float]  # champion's metrics on fresh draws, as ``champion.NAME``
    files: Mapping[str, bytes]  # champion and figure files by path in the run folder
    time_s: float

    @cached_property
    def digest(self) -> str:
        """A digest of state, metrics and files, which differs after changes."""
        content = hashlib.sha256(repr((self.state, sorted(self.metrics.items()))).encode())
        for name, data in sorted(self.files.items()):
            content.update(f"{name}\0{len(data)}\0".encode() + data)
        return content.hexdigest()


@dataclass(frozen=True)
class ObservedRun:
    """The records of a run so far."""

    id: str  # 32 hexadecimal digits, independent of the folder
    name: str  # folder name
    sweep: str | None  # absolute path of the original sweep folder
    parameters: Mapping[str, Value]  # configuration values by dotted key
    origin: Path  # base folder of relative tracker paths
    started_s: float  # Unix time
    generations: Sequence[ObservedGeneration]  # all generations, starting with 0
    end: ObservedEnd | None  # None while the run continues

    @property
    def group(self) -> str | None:
        """The name of the sweep."""
        return None if self.sweep is None else Path(self.sweep).name


Send: TypeAlias = Callable[[ObservedRun], None]  # sends new records to the tracker, after each one


class Observer(ABC):
    """Sends runs to a tracker. Observers affect no results, and their errors stop no runs."""

    def check(self) -> None:  # noqa: B027 - an observer may need nothing
        """Check local requirements, such as a package; raise an InputError if one is not met."""

    @abstractmethod
    def open(self, run: ObservedRun) -> AbstractContextManager[Send]:
        """Connect to the tracker for a run, which may already have been sent in part or in full.

        Trackers recognise the run by its ``id``. The connection is closed when the context exits.
        """


OBSERVERS = mapping_of(Observer, "observers (subclasses of evoros.parts.Observer)")
