"""The protocol of observers, and the frozen data that they get."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Protocol, TypeAlias, runtime_checkable

from evoros.base.checks import mapping_of

FREE = ("executor", "observers")
"""Keys of the configuration on which no result depends: no part of what a run is. An evaluation has
no observers."""
Value: TypeAlias = str | int | float | bool | None
"""A value of the configuration; lists are texts, and references to the environment stay so."""


@dataclass(frozen=True)
class ObservedGeneration:
    """A recorded generation."""

    number: int  # from 0
    metrics: Mapping[str, float]  # of its best candidate, and the mean fitness; all are finite
    time_s: float  # Unix time at which it was recorded


@dataclass(frozen=True)
class ObservedEnd:
    """How a run ended, for now: it may be resumed, or extended."""

    state: str  # finished, stopped or killed
    metrics: Mapping[str, float]  # of the champion on fresh draws, by ``champion.NAME``
    files: Mapping[str, bytes]  # of the champion and the figures, by their paths in the run folder
    time_s: float

    @cached_property
    def digest(self) -> str:
        """A digest of the state, the metrics and the files, by which a change is noticed."""
        content = hashlib.sha256(repr((self.state, sorted(self.metrics.items()))).encode())
        for name, data in sorted(self.files.items()):
            content.update(f"{name}\0{len(data)}\0".encode() + data)
        return content.hexdigest()


@dataclass(frozen=True)
class ObservedRun:
    """What a run has recorded so far."""

    id: str  # of the run, wherever its folder lies: 32 hexadecimal digits
    name: str  # of its folder
    sweep: str | None  # the absolute path at which the folder of its sweep was made
    parameters: Mapping[str, Value]  # the configuration by dotted key
    origin: Path  # the folder in which relative paths of a tracker begin
    started_s: float  # Unix time
    generations: Sequence[ObservedGeneration]  # from 0, none is missing
    end: ObservedEnd | None  # None: the run goes on

    @property
    def group(self) -> str | None:
        """The name of the sweep."""
        return None if self.sweep is None else Path(self.sweep).name


Send: TypeAlias = Callable[[ObservedRun], None]
"""Sends what the tracker has not yet. It is called again whenever the run has recorded more."""


@runtime_checkable
class Observer(Protocol):
    """Sends runs to a tracker. No result depends on it, and an error of it stops no run."""

    def check(self) -> None:
        """Require what it needs on this machine, such as a package. Connect to nothing.

        Raises:
            InputError: it is not there.
        """
        ...

    def open(self, run: ObservedRun) -> AbstractContextManager[Send]:
        """Connect to the tracker for a run, which may have been sent in part, or as a whole.

        The tracker recognises it by its ``id``. Leaving the context ends the connection.
        """
        ...


OBSERVERS = mapping_of(Observer, "observers (check and open)")
