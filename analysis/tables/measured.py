"""Objectives and descriptors of the individuals of a run, as tables."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from evoros.base.errors import InputError

from .candidates import read_generations
from .records import Record
from .study import Study


@dataclass(frozen=True)
class Axis:
    """One measure of a run."""

    column: str  # of the generations' tables, which is its key too
    label: str
    bounds: tuple[float, float]
    sign: float  # -1 if it is to be minimized


def read_axes(record: Record, group: str) -> list[Axis]:
    """Read the measures of a run that are ``OBJECTIVES`` or ``DESCRIPTORS``."""
    columns = [str(name) for name in read_generations(record) if str(name).startswith(f"{group}.")]
    return [_read_axis(record, column) for column in columns]


def _read_axis(record: Record, column: str) -> Axis:
    values, name = record.values, record.context.measures.get(column)
    label = name.label if name else column.partition(".")[2].replace("_", " ")
    low, high = map(float, values.get(f"{column}.bounds", (0.0, 1.0)))
    sign = -1.0 if values.get(f"{column}.direction") == "minimize" else 1.0
    return Axis(column, label, (low, high), sign)


def add_choice(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the two measures that are drawn."""
    for name, default in (("x", "first"), ("y", "second")):
        about = f"measure along {name}; the {default} one"
        parser.add_argument(f"--{name}", metavar="NAME", help=about)


def choose_axes(study: Study, group: str, options: argparse.Namespace) -> tuple[Axis, Axis]:
    """Choose the two measures that are drawn, of the first run."""
    if not study.records:
        raise InputError(f"{options.subcommand}: must be given a run; give the folder of one")
    known = {axis.column.partition(".")[2]: axis for axis in read_axes(study.records[0], group)}
    if len(known) < 2:
        raise InputError(
            f"{study.records[0].path}: must have recorded two {group}, not {list(known)}; start a "
            f"run with two or more, for example +measure@{group}.spread=spread"
        )
    names = [options.x or next(name for name in known if name != options.y)]
    names.append(options.y or next(name for name in known if name != names[0]))
    for option, name in zip("xy", names, strict=True):
        if name not in known or names[0] == names[1]:
            raise InputError(
                f"--{option}: must be another one of {', '.join(known)}, not {name}; correct it"
            )
    return known[names[0]], known[names[1]]


def read_measured(record: Record, axes: Sequence[Axis]) -> pd.DataFrame:
    """Read all rows of a run's generations, which have the columns of ``axes``."""
    table = read_generations(record)
    for axis in axes:
        if axis.column not in table:
            raise InputError(
                f"{record.path}: must have recorded {axis.column}, as the first run has; give runs "
                f"with equal measures"
            )
    return table


def take_latest(table: pd.DataFrame) -> pd.DataFrame:
    """Return the last row of each individual, whose score may have changed."""
    return table.drop_duplicates("id", keep="last")


def count_missions(record: Record) -> "pd.Series[int]":
    """Count the missions up to each generation, except validations."""
    missions = record.run.missions
    counts = missions[missions.purpose != "validation"].groupby("generation").size()
    numbers = sorted(read_generations(record).generation.unique())
    return counts.reindex(numbers, fill_value=0).cumsum()
