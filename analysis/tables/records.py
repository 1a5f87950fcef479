"""One folder of a study: a run, or an evaluation of given designs."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from evoros.base.errors import InputError
from evoros.fitness.naming import UNBOUNDED
from evoros.storage.doubts import warn_not_run
from evoros.storage.figure_context import FigureContext
from evoros.storage.layout import FINISHED, advise_finish
from evoros.storage.reading import Run, load_run, read_table

from .factors import read_choices, read_given
from .values import read_values

FITNESS = "fitness"
SHARES = ("_completed", "_progress")
"""Ends of columns that are shares."""


@dataclass(frozen=True, eq=False)
class Record:
    """A run of a study."""

    name: str  # the end of its path that no other folder of the study has
    run: Run
    context: FigureContext
    values: Mapping[str, Any]  # of the configuration, by dotted key
    treatment: str = ""  # label of what differs between the runs of the study, except the seed
    levels: Mapping[str, str] = field(default_factory=dict)  # by factor of the study
    given: Mapping[str, Any] = field(default_factory=dict)  # the treatment as the user calls it
    agent: str = ""  # the robot that it is about, if it is not the first one

    @property
    def path(self) -> Path:
        """The folder."""
        return self.run.path

    @property
    def robot_folder(self) -> Path:
        """The folder of the champion's robot."""
        folder = self.path / "champion"
        return folder / "agents" / self.agent if self.agent else folder

    @property
    def choices(self) -> dict[str, str]:
        """The recorded choices of the groups, by the key of the part that they configure."""
        return read_choices(self.run.manifest.get("choices"))

    @property
    def seed(self) -> int:
        """The configured seed."""
        return int(self.values["seed"])

    @cached_property
    def not_run(self) -> str:
        """A warning if none of its missions could be run; otherwise empty."""
        return warn_not_run(self.path)

    @property
    def finished(self) -> bool:
        """Whether the run is finished, so that it has a champion."""
        return bool(self.run.status.get("state") == FINISHED)

    @property
    def progress(self) -> str:
        """How far the run is, if it is not finished."""
        done, wanted = (self.run.status.get(key) for key in ("generations_done", "generations"))
        return f"{self.path}: is not finished; shown as far as it is: generation {done} of {wanted}"

    def require_finished(self) -> None:
        """Require that the run is finished, so that it has a champion."""
        if not self.finished:
            state = self.run.status.get("state")
            raise InputError(
                f"{self.path}: must be a finished run, which has a champion, but its state is "
                f"{state}; {advise_finish(self.path)}"
            )


class EvaluationRecord(Record):
    """An evaluation of given designs."""

    @cached_property
    def mounts(self) -> pd.DataFrame:
        """A row for each sensor of the given designs; one row for a design without sensors."""
        return read_table(self.path / "designs_in.csv", ("x_m", "y_m", "z_m", "yaw_deg"))

    @cached_property
    def genes(self) -> pd.DataFrame:
        """A row for each other evolved value of the given designs."""
        return read_table(self.path / "genes_in.csv", ("value",))


def read_record(folder: Path, name: str) -> Record:
    """Read the run or evaluation in a folder; large tables are read when they are used."""
    run = load_run(folder)
    kind = EvaluationRecord if run.evaluates else Record
    values = read_values(folder / "config.yaml")
    if not isinstance(values.get("seed"), int):
        raise InputError(
            f"{folder / 'config.yaml'}: seed must be a whole number, not {values.get('seed')!r}; "
            f"restore the file"
        )
    _ = run.status  # raises if it is damaged
    return kind(name, run, FigureContext.read(folder), values, given=read_given(values))


def label_fitness(records: Iterable[Record]) -> str:
    """Return the title and unit of the fitness; "fitness" alone if the records have several."""
    labels = {record.context.fitness.label for record in records}
    return labels.pop() if len(labels) == 1 else FITNESS


def bound_measure(measure: str, records: Iterable[Record]) -> tuple[float, float]:
    """Return the minimum and maximum of a measure of runs; infinite if they are unknown."""
    if measure.endswith(SHARES):
        return 0.0, 1.0
    bounds = {record.context.fitness.bounds for record in records}
    if measure != FITNESS or len(bounds) > 1 or () in bounds:
        return UNBOUNDED
    low, high = bounds.pop()
    return low, high


def label_by_treatment(records: Iterable[Record]) -> dict[str, str]:
    """Return the title and unit of the fitness of each treatment."""
    return {record.treatment: record.context.fitness.label for record in records}
