"""A study: the runs and evaluations in some folders, as far as they are whole.

Everything is read from plain files: nothing that a folder's configuration names is imported.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TypeVar

import pandas as pd

from evoros.base.errors import InputError
from evoros.base.log import LOGGER

from .designs import champion_sensors, generations, initial_sensors, number
from .folders import folders_of, short_names
from .records import Record, Scored, read_record
from .treatments import labels

KEYS = ("run", "treatment", "seed")
"""The first columns of every table of a study."""


NO_RUNS = "this needs runs, and only evaluations were given; give the folder of a run"
Found = TypeVar("Found", bound=Record)
Read = TypeVar("Read")


@dataclass(frozen=True, eq=False)
class Study:
    """Runs and evaluations, in the order of their names."""

    records: tuple[Record, ...]
    evaluations: tuple[Scored, ...] = ()
    left_out: tuple[str, ...] = ()
    """A line for each folder that is not whole."""
    _said: set[str] = field(default_factory=set, repr=False)

    def gather(self, read: Callable[[Record], pd.DataFrame]) -> pd.DataFrame:
        """The tables of all runs below each other, with ``run``, ``treatment`` and ``seed`` first.

        A run whose files cannot be read is left out, and that is said in one line.

        Raises:
            InputError: none is left.
        """
        frames = []
        for record, frame in self.each(self.records, read):
            others = [name for name in frame.columns if name not in KEYS]
            marked = frame.assign(run=record.name, treatment=record.treatment, seed=record.seed)
            frames.append(marked[[*KEYS, *others]])
        if not any(len(frame) for frame in frames):
            raise InputError(
                "none of the runs has what this needs; give folders of whole runs"
                if self.records
                else NO_RUNS
            )
        return pd.concat([frame for frame in frames if len(frame)], ignore_index=True)

    def each(
        self, records: Iterable[Record], read: Callable[[Record], Read]
    ) -> Iterator[tuple[Record, Read]]:
        """What is read of each of the records; one that cannot be read is left out and said."""
        for record in records:
            try:
                yield record, _attempt(record, read)
            except InputError as error:
                self.leave_out(str(error))

    def leave_out(self, why: str) -> None:
        """Say what is left out of a figure, once."""
        if why not in self._said:
            LOGGER.warning("%s; left out", why)
        self._said.add(why)

    @cached_property
    def generations(self) -> pd.DataFrame:
        """A row for each candidate of each generation of each run."""
        return self.gather(generations)

    @cached_property
    def champions(self) -> pd.DataFrame:
        """A row for each sensor of each finished run's champion; see ``designs``.

        With ``fitness`` and ``validated_fitness``.
        """
        return self.gather(champion_sensors)

    @cached_property
    def initial(self) -> pd.DataFrame:
        """A row for each sensor of the designs that the runs began with, made at random."""
        return self.gather(initial_sensors)

    @property
    def treatments(self) -> tuple[str, ...]:
        """Their labels, in the order of the runs."""
        return tuple(dict.fromkeys(record.treatment for record in self.records))

    def check_worlds(self, names: Iterable[str]) -> None:
        """One of the runs must have each of these worlds.

        Raises:
            InputError: none has.
        """
        known = dict.fromkeys(name for record in self.records for name in record.setting.courses)
        for name in names:
            if name not in known:
                raise InputError(
                    f"--world: must be one of {', '.join(known)}, not {name!r}; correct the name"
                )

    def only(self, name: str) -> Record:
        """The run of this name, or whose name alone ends so.

        Raises:
            InputError: there is none, or more than one.
        """
        exact = [record for record in self.records if record.name == name]
        found = exact or [record for record in self.records if record.name.endswith(name)]
        if len(found) != 1:
            names = ", ".join(record.name for record in found or self.records)
            raise InputError(f"--run: must be the name of one run, not {name!r}; one of {names}")
        return found[0]

    @cached_property
    def ranked(self) -> tuple[Record, ...]:
        """The finished runs from the best: by validated fitness, where there is none by recorded.

        Raises:
            InputError: none is finished.
        """
        whole = [record for record in self.records if record.finished]
        if not self.records:
            raise InputError(NO_RUNS)
        if not whole:
            paths = ", ".join(str(record.path) for record in self.records[:3])
            raise InputError(f"{paths}: must be finished, to have a champion; resume it")
        return tuple(sorted(whole, key=_rank, reverse=True))

    def chosen(self, name: str | None, read: Callable[[Record], Read]) -> tuple[Record, Read]:
        """The run of a name, or the best of those of which this can be read; and what was read.

        Raises:
            InputError: there is no such run, or of none this can be read.
        """
        among = self.ranked if name is None else Study((self.only(name),)).ranked
        if len(among) == 1:
            return among[0], _attempt(among[0], read)
        for found in self.each(among, read):
            return found
        raise InputError("of none of the runs the champion can be shown; restore one, or resume it")


def _attempt(record: Record, read: Callable[[Record], Read]) -> Read:
    """What is read of the record; whatever is wrong with its files is one error."""
    try:
        return read(record)
    except (LookupError, ValueError, TypeError, AttributeError) as error:
        said = " ".join(str(error).split())
        raise InputError(
            f"{record.path}: its files must be whole ({said}); restore them"
        ) from error


def _rank(record: Record) -> tuple[float, float]:
    scores = [number(record.run.status.get(f"best_{of}fitness")) for of in ("validated_", "")]
    first, second = (-math.inf if math.isnan(score) else score for score in scores)
    return first, second


def load_study(paths: Sequence[Path]) -> Study:
    """What is whole in these folders: of runs, of evaluations, or of sweeps of them.

    What is not is said, in a line for each.

    Raises:
        InputError: a path leads nowhere, or nothing is whole.
    """
    found = folders_of(paths)
    names = short_names(found)
    records: list[Record] = []
    evaluations: list[Scored] = []
    left_out: list[str] = []
    for folder in found:
        try:
            record = read_record(folder, names[folder])
        except InputError as error:
            LOGGER.warning("%s; left out", error)
            left_out.append(str(error))
            continue
        if isinstance(record, Scored):
            evaluations.append(record)
        else:
            records.append(record)
    if not records and not evaluations:
        given = ", ".join(map(str, paths))
        raise InputError(
            f"{given}: must hold whole runs or evaluations, and there is none; see above"
        )
    return Study(_labelled(records), _labelled(evaluations), tuple(left_out))


def _labelled(records: Sequence[Found]) -> tuple[Found, ...]:
    names = labels([record.values for record in records])
    return tuple(replace(r, treatment=name) for r, name in zip(records, names, strict=True))
