"""One folder of a study: a run, or an evaluation of given designs."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext
from evoros.storage.reading import Run, load_run, read_table

from .values import read_values

EVALUATED = "evoros-evaluate"
"""The command that makes the folders of evaluations."""


@dataclass(frozen=True, eq=False)
class Record:
    """A run."""

    name: str  # its folder, as short as it can be told from the others of the study
    run: Run
    setting: FigureContext
    values: Mapping[str, Any]  # of the configuration, by dotted key
    treatment: str = ""  # what it differs in from others of the study, its seed apart

    @property
    def path(self) -> Path:
        """Its folder."""
        return self.run.path

    @property
    def seed(self) -> int:
        """Of the configuration."""
        return int(self.values["seed"])

    @property
    def finished(self) -> bool:
        """Whether it has a champion."""
        return bool(self.run.status.get("state") == "finished")


class Scored(Record):
    """An evaluation of given designs; ``run`` has its manifest, status and missions."""

    @cached_property
    def designs(self) -> pd.DataFrame:
        """A row for each design, with its fitness; the evaluation must be finished."""
        return read_table(self.path / "designs.csv", ("fitness_mean", "fitness_sd", "trials"))

    @cached_property
    def given(self) -> pd.DataFrame:
        """A row for each sensor of the designs; one for a design without any."""
        return read_table(self.path / "designs_in.csv", ("x_m", "y_m", "z_m", "yaw_deg"))

    @cached_property
    def genes(self) -> pd.DataFrame:
        """A row for each other value of the designs."""
        return read_table(self.path / "genes_in.csv", ("value",))

    @cached_property
    def missions(self) -> pd.DataFrame:
        """A row for each finished mission."""
        return read_table(self.path / "missions.csv", ("trial", "progress", "time_s"), growing=True)


def read_record(folder: Path, name: str) -> Record:
    """What a folder holds, under a name; nothing but small files is read yet.

    Raises:
        InputError: it is not that of a run or an evaluation, or a file is damaged.
    """
    run = load_run(folder)
    made = Scored if run.manifest.get("command") == EVALUATED else Record
    values = read_values(folder / "config.yaml")
    if not isinstance(values.get("seed"), int):
        raise InputError(f"{folder / 'config.yaml'}: must have a whole number as seed; restore it")
    _ = run.status
    return made(name, run, FigureContext.read(folder), values)
