"""A study: complete runs and evaluations in folders, read without importing their code."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import pandas as pd

from evoros.base.errors import InputError, single_line
from evoros.storage.figure_context import Ring
from evoros.terminal.log import LOGGER

from . import designs
from .champions import read_champion_sensors, read_champion_signals
from .records import EvaluationRecord, Record

KEYS = ("run", "treatment", "seed")  # first columns of every table in a study
NO_RUNS = "no run found, only evaluations; add the folder of a run"
AnyRecord = TypeVar("AnyRecord", bound=Record)
Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class Study:
    """Runs and evaluations, sorted by name."""

    records: tuple[Record, ...]
    evaluations: tuple[EvaluationRecord, ...] = ()
    left_out: tuple[str, ...] = ()  # a line for each incomplete or damaged folder
    given: tuple[Record, ...] = ()  # all runs, including those that repeat a configuration and seed
    _reported: set[str] = field(default_factory=set, repr=False)

    def gather(self, read: Callable[[Record], pd.DataFrame]) -> pd.DataFrame:
        """Concatenate the tables of all runs, with ``KEYS`` first; report unreadable runs."""
        frames = self._mark(self.records, read)
        if not frames:
            without = "none of the runs has the required data; give the folders of complete runs"
            raise InputError(without if self.records else NO_RUNS)
        return pd.concat(frames, ignore_index=True)

    def _mark(
        self, records: Iterable[Record], read: Callable[[Record], pd.DataFrame]
    ) -> list[pd.DataFrame]:
        frames = []
        for record, frame in self.read_each(records, read):
            marked = frame.assign(run=record.name, treatment=record.treatment, seed=record.seed)
            frames.append(marked[[*KEYS, *frame.columns.difference([*KEYS], sort=False)]])
        return [frame for frame in frames if len(frame)]

    def read_each(
        self, records: Iterable[AnyRecord], read: Callable[[AnyRecord], Result]
    ) -> Iterator[tuple[AnyRecord, Result]]:
        """Yield each record with the result of ``read``; skip unreadable records with a warning."""
        for record in records:
            try:
                result = self._read(record, read)
            except InputError as error:
                self.report(str(error))
            else:
                yield record, result

    def _read(self, record: AnyRecord, read: Callable[[AnyRecord], Result]) -> Result:
        result = read_complete(record, read)
        if not record.finished:
            self._warn(record.progress)
        return result

    def report(self, reason: str) -> None:
        """Warn, once per reason, that a figure omits something."""
        self._warn(f"{reason}; left out")

    def _warn(self, line: str) -> None:
        if line not in self._reported:
            LOGGER.warning("%s", line)
        self._reported.add(line)

    @cached_property
    def generations(self) -> pd.DataFrame:
        """One row per candidate, generation and run."""
        return self.gather(designs.read_generations)

    @cached_property
    def champions(self) -> pd.DataFrame:
        """One row per sensor of each champion, with the columns of ``panel.csv``."""
        return self.gather(read_champion_sensors)

    @cached_property
    def signals(self) -> pd.DataFrame:
        """One row per sensor without rays of each champion; may be empty."""
        others = [record for record in self.records if record.context.signals]
        return _concatenate(self._mark(others, read_champion_signals), designs.SIGNAL_COLUMNS)

    @cached_property
    def initial(self) -> pd.DataFrame:
        """One row per sensor of the random designs in generation 0; may be empty."""
        return _concatenate(self._mark(self.records, designs.read_initial_sensors), designs.COLUMNS)

    @property
    def treatments(self) -> tuple[str, ...]:
        """The labels of the treatments, in the order of the runs."""
        return tuple(dict.fromkeys(record.treatment for record in self.records))

    @property
    def factors(self) -> tuple[str, ...]:
        """The names of the factors that differ between runs."""
        return tuple(dict.fromkeys(name for record in self.records for name in record.levels))

    @property
    def rings(self) -> tuple[Ring, ...]:
        """The damage rings of the first run with spatial damage; empty if there is none."""
        return next((record.context.rings for record in self.records if record.context.rings), ())

    def check_worlds(self, names: Iterable[str]) -> None:
        """Check that each named world occurs in at least one run."""
        if not self.records:
            raise InputError(NO_RUNS)
        known = dict.fromkeys(name for record in self.records for name in record.context.courses)
        for name in names:
            if name not in known:
                raise InputError(f"--world: must be one of {', '.join(known)}, not {name!r}")

    def select_finished(self, *reads: Callable[[Record], object]) -> "Study":
        """Keep the finished runs that all ``reads`` accept; report every other run once."""

        def check(record: Record) -> pd.DataFrame:
            record.require_finished()
            for read in reads:
                read(record)
            return pd.DataFrame({"complete": [True]})

        names = set(self.gather(check).run)
        return self.keep(record for record in self.records if record.name in names)

    def keep(self, records: Iterable[Record]) -> "Study":
        """Return the study with only the given runs, and with all evaluations."""
        return replace(self, records=tuple(records))

    def find(self, name: str) -> Record:
        """Return the run with this name, or the only run whose name ends with it."""
        exact = [record for record in self.records if record.name == name]
        matches = exact or [record for record in self.records if record.name.endswith(name)]
        if len(matches) != 1:
            names = ", ".join(record.name for record in matches or self.records)
            raise InputError(
                f"--run: must be the name of one run, not {name!r}; choose one of {names}"
            )
        return matches[0]

    @cached_property
    def ordered(self) -> tuple[Record, ...]:
        """The finished runs, then all others, ordered by validated, then recorded fitness."""
        if not self.records:
            raise InputError(NO_RUNS)
        best_first = sorted(self.records, key=_fitness, reverse=True)
        return tuple(sorted(best_first, key=lambda record: not record.finished))

    @property
    def ranked(self) -> tuple[Record, ...]:
        """The finished runs, best first; it is an error if there are none."""
        finished = tuple(record for record in self.ordered if record.finished)
        if not finished:
            self.records[0].require_finished()
        return finished

    def choose(
        self, name: str | None, read: Callable[[Record], Result], unfinished: bool = False
    ) -> tuple[Record, Result]:
        """Read the named run, by default the best readable run; finished runs precede others."""
        study = self if name is None else self.keep([self.find(name)])
        candidates = study.ordered if unfinished else study.ranked
        if len(candidates) == 1:
            return candidates[0], self._read(candidates[0], read)
        for record, result in self.read_each(candidates, read):
            return record, result
        raise InputError("no run has a champion that can be shown; restore or resume a run")


def _concatenate(frames: Sequence[pd.DataFrame], columns: Sequence[str]) -> pd.DataFrame:
    return pd.concat(frames or [pd.DataFrame(columns=[*KEYS, *columns])], ignore_index=True)


def read_complete(record: AnyRecord, read: Callable[[AnyRecord], Result]) -> Result:
    """Read the record; convert any error in its files to an ``InputError``."""
    try:
        return read(record)
    except (LookupError, ValueError, TypeError, AttributeError) as error:
        raise InputError(
            f"{record.path}: incomplete or damaged files ({single_line(error)}); restore the folder"
        ) from error


def _fitness(record: Record) -> tuple[float, float]:
    names = ("best_validated_fitness", "best_fitness")
    scores = (designs.to_number(record.run.status.get(name)) for name in names)
    first, second = (-math.inf if math.isnan(score) else score for score in scores)
    return first, second
