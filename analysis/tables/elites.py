"""The best design per cell of a grid over two descriptors, and Pareto fronts."""

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.measure.protocol import DESCRIPTORS, OBJECTIVES

from .costs import read_costs
from .designs import read_generations
from .records import Record
from .study import Study

MOST_CELLS = 1000


@dataclass(frozen=True)
class Axis:
    """A measure of runs along an axis."""

    column: str  # key of the measure, and its column in the generations table
    label: str
    bounds: tuple[float, float]
    sign: float  # -1 if minimized

    @property
    def directed_label(self) -> str:
        """The label with the direction of better values."""
        return f"{self.label} ({'higher' if self.sign > 0 else 'lower'} is better)"


Grid = tuple[Axis, Axis, int]  # two descriptors, and the number of cells along each


def _read_axes(record: Record, group: str) -> list[Axis]:
    columns = [str(name) for name in read_generations(record) if str(name).startswith(f"{group}.")]
    return [_read_axis(record, column) for column in columns]


def _read_axis(record: Record, column: str) -> Axis:
    values, name = record.values, record.context.measures.get(column)
    label = name.label if name else column.partition(".")[2].replace("_", " ")
    low, high = map(float, values.get(f"{column}.bounds", (0.0, 1.0)))
    sign = -1.0 if values.get(f"{column}.direction") == "minimize" else 1.0
    return Axis(column, label, (low, high), sign)


def add_choice(parser: argparse.ArgumentParser) -> None:
    """Add ``--x`` and ``--y``, the two measures to draw."""
    for name, default in (("x", "first"), ("y", "second")):
        about = f"measure along the {name} axis; default: the {default} measure"
        parser.add_argument(f"--{name}", metavar="NAME", help=about)


def _choose_axes(study: Study, group: str, options: argparse.Namespace) -> tuple[Axis, Axis]:
    if not study.records:
        raise InputError(f"{options.subcommand}: no run found; add a run's folder")
    known = {axis.column.partition(".")[2]: axis for axis in _read_axes(study.records[0], group)}
    if len(known) < 2:
        raise InputError(
            f"{study.records[0].path}: at least two recorded {group} are needed, but it has only "
            f"{list(known)}; start a run with two, for example +measure@{group}.spread=spread "
            f"+measure@{group}.front=front_coverage"
        )
    names = [options.x or next(name for name in known if name != options.y)]
    names.append(options.y or next(name for name in known if name != names[0]))
    for option, name in zip("xy", names, strict=True):
        if name not in known or names[0] == names[1]:
            raise InputError(
                f"--{option}: must be one of {', '.join(known)} and differ from the other axis, "
                f"not {name}"
            )
    return known[names[0]], known[names[1]]


def _read_measured(record: Record, axes: Sequence[Axis]) -> pd.DataFrame:
    table = read_generations(record)
    for axis in axes:
        if axis.column not in table:
            raise InputError(
                f"{record.path}: {axis.column} was not recorded, unlike in the first run; give "
                "runs with the same measures"
            )
    return table


def take_latest(table: pd.DataFrame) -> pd.DataFrame:
    """Return the last row of each individual, because scores may change between generations."""
    return table.drop_duplicates("id", keep="last")


class Archive(NamedTuple):
    """The candidates of all runs in a study, on one grid."""

    grid: Grid
    candidates: pd.DataFrame  # latest scores; ``place`` is the index of the run
    growth: pd.DataFrame  # one row per run and generation

    def select_elites(self, places: Sequence[int]) -> pd.DataFrame:
        """Select the fittest candidate of some runs in each cell, fittest first."""
        return find_elites(self.candidates[self.candidates.place.isin(places)], self.grid)


class Front(NamedTuple):
    """The candidates of all runs in a study, and the two objectives to draw."""

    x: Axis
    y: Axis
    objectives: Sequence[Axis]
    candidates: pd.DataFrame  # latest scores; ``place`` is the index of the run

    def select_front(self, places: Sequence[int]) -> pd.DataFrame:
        """Select the nondominated candidates of some runs, sorted by ``x``."""
        rows = self.candidates[self.candidates.place.isin(places)]
        values = np.column_stack([axis.sign * rows[axis.column] for axis in self.objectives])
        columns = [self.x.column, self.y.column]
        return rows[find_front(values)].sort_values(columns, ignore_index=True)


def read_archive(study: Study, options: argparse.Namespace) -> Archive:
    """Read the archive; ``options`` holds the descriptors ``x`` and ``y``, and ``cells``."""
    x, y = _choose_axes(study, DESCRIPTORS, options)
    cells = options.cells or int(study.records[0].values.get("optimizer.cells", 10))
    if not 1 <= cells <= MOST_CELLS:
        raise InputError(f"--cells: must be a number from 1 to {MOST_CELLS}, not {cells}")
    grid = (x, y, cells)
    tables = [_read_measured(record, (x, y)) for record in study.records]
    growth = [
        trace_growth(table, read_costs(record, "missions").astype(int), grid).assign(
            run=record.name, treatment=record.treatment
        )
        for record, table in zip(study.records, tables, strict=True)
    ]
    return Archive(grid, _pool(study, tables), pd.concat(growth, ignore_index=True))


def _pool(study: Study, tables: Iterable[pd.DataFrame]) -> pd.DataFrame:
    latest = [
        take_latest(table).assign(place=place, run=record.name, treatment=record.treatment)
        for place, (record, table) in enumerate(zip(study.records, tables, strict=True))
    ]
    return pd.concat(latest, ignore_index=True)


def find_elites(candidates: pd.DataFrame, grid: Grid) -> pd.DataFrame:
    """Return the fittest candidate of each occupied cell, fittest first."""
    *axes, cells = grid
    columns = {}
    for name, axis in zip(("cell_x", "cell_y"), axes, strict=True):
        low, high = axis.bounds
        share = (candidates[axis.column].to_numpy(float) - low) / (high - low)
        columns[name] = np.clip(np.floor(share * cells), 0, cells - 1).astype(int)
    ranked = candidates.assign(**columns).sort_values(
        ["fitness", "id"], ascending=[False, True], kind="stable"
    )
    return ranked.drop_duplicates(["cell_x", "cell_y"]).reset_index(drop=True)


def trace_growth(table: pd.DataFrame, missions: "pd.Series[int]", grid: Grid) -> pd.DataFrame:
    """Return the cumulative missions, the coverage and the QD score by generation.

    The QD score is the elites' total fitness (Pugh et al., Front. Robot. AI 3, 2016).
    """
    rows = []
    for generation, count in missions.items():
        elites = find_elites(take_latest(table[table.generation <= generation]), grid)
        row = {"generation": generation, "missions": count, "coverage": len(elites) / grid[2] ** 2}
        rows.append({**row, "qd_score": float(elites.fitness.sum())})
    return pd.DataFrame(rows)


def read_front(study: Study, options: argparse.Namespace) -> Front:
    """Read the objectives; ``options`` names the objectives ``x`` and ``y`` to draw."""
    x, y = _choose_axes(study, OBJECTIVES, options)
    axes = _read_axes(study.records[0], OBJECTIVES)
    tables = (_read_measured(record, axes) for record in study.records)
    return Front(x, y, axes, _pool(study, tables))


def find_front(values: Array) -> Array:
    """Return a mask of the nondominated rows of values (n, objectives), all to be maximized."""
    kept = np.ones(len(values), dtype=bool)
    for i, row in enumerate(values):
        better = np.all(values >= row, axis=1) & np.any(values > row, axis=1)
        kept[i] = not better.any()
    return kept
