"""The best design in each cell of a grid over two descriptors, and the front of two objectives."""

import argparse
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.measure.protocol import DESCRIPTORS, OBJECTIVES

from .measured import Axis, choose_axes, count_missions, read_axes, read_measured, take_latest
from .study import Study

MOST_CELLS = 1000
Grid = tuple[Axis, Axis, int]
"""Two descriptors, and the number of cells along each."""


class Archive(NamedTuple):
    """The candidates of the runs of a study, for one grid."""

    grid: Grid
    candidates: pd.DataFrame  # as last scored; ``place`` is the index of their run
    growth: pd.DataFrame  # of each run by its generations

    def select_elites(self, places: Sequence[int]) -> pd.DataFrame:
        """Select the fittest of some runs together in each cell, the fittest first."""
        return find_elites(self.candidates[self.candidates.place.isin(places)], self.grid)


class Front(NamedTuple):
    """The candidates of the runs of a study, and the two objectives that are drawn."""

    x: Axis
    y: Axis
    objectives: Sequence[Axis]
    candidates: pd.DataFrame  # as last scored; ``place`` is the index of their run

    def select_front(self, places: Sequence[int]) -> pd.DataFrame:
        """Select those that no other one of some runs exceeds, in the order of both objectives."""
        rows = self.candidates[self.candidates.place.isin(places)]
        values = np.column_stack([axis.sign * rows[axis.column] for axis in self.objectives])
        columns = [self.x.column, self.y.column]
        return rows[find_front(values)].sort_values(columns, ignore_index=True)


def read_archive(study: Study, options: argparse.Namespace) -> Archive:
    """Read the archive; ``options`` choose the descriptors, ``x`` and ``y``, and the ``cells``."""
    x, y = choose_axes(study, DESCRIPTORS, options)
    cells = options.cells or int(study.records[0].values.get("optimizer.cells", 10))
    if not 1 <= cells <= MOST_CELLS:
        raise InputError(
            f"--cells: must be a number from 1 to {MOST_CELLS}, not {cells}; set it to 10"
        )
    grid = (x, y, cells)
    tables = [read_measured(record, (x, y)) for record in study.records]
    growth = [
        trace_growth(table, count_missions(record), grid).assign(
            run=record.name, treatment=record.treatment
        )
        for record, table in zip(study.records, tables, strict=True)
    ]
    return Archive(grid, _pool(tables), pd.concat(growth, ignore_index=True))


def _pool(tables: Iterable[pd.DataFrame]) -> pd.DataFrame:
    """Concatenate the latest scores of runs; ``place`` is the index of the run."""
    latest = [take_latest(table).assign(place=place) for place, table in enumerate(tables)]
    return pd.concat(latest, ignore_index=True)


def assign_cells(table: pd.DataFrame, grid: Grid) -> pd.DataFrame:
    """Return the cells of candidates; those beyond the bounds are in the outermost ones."""
    *axes, cells = grid
    columns = {}
    for name, axis in zip(("cell_x", "cell_y"), axes, strict=True):
        low, high = axis.bounds
        share = (table[axis.column].to_numpy(float) - low) / (high - low)
        columns[name] = np.clip(np.floor(share * cells), 0, cells - 1).astype(int)
    return table.assign(**columns)


def find_elites(candidates: pd.DataFrame, grid: Grid) -> pd.DataFrame:
    """Return the fittest candidate of each cell that has one, the fittest first."""
    ranked = assign_cells(candidates, grid).sort_values(
        ["fitness", "id"], ascending=[False, True], kind="stable"
    )
    return ranked.drop_duplicates(["cell_x", "cell_y"]).reset_index(drop=True)


def trace_growth(table: pd.DataFrame, missions: "pd.Series[int]", grid: Grid) -> pd.DataFrame:
    """Return a row for each generation: missions so far, coverage 0..1 and QD score.

    The coverage is the share of cells that have a design. The QD score is the sum of the fitness of
    their elites (Pugh et al., Frontiers in Robotics and AI 3, 2016).
    """
    rows = []
    for generation, count in missions.items():
        elites = find_elites(take_latest(table[table.generation <= generation]), grid)
        row = {"generation": generation, "missions": count, "coverage": len(elites) / grid[2] ** 2}
        rows.append({**row, "qd_score": float(elites.fitness.sum())})
    return pd.DataFrame(rows)


def read_front(study: Study, options: argparse.Namespace) -> Front:
    """Read the objectives; ``options`` choose two, ``x`` and ``y``, that are drawn."""
    x, y = choose_axes(study, OBJECTIVES, options)
    axes = read_axes(study.records[0], OBJECTIVES)
    return Front(x, y, axes, _pool(read_measured(record, axes) for record in study.records))


def find_front(values: Array) -> Array:
    """Return which rows of (n, objectives), all maximized, no other one dominates."""
    kept = np.ones(len(values), dtype=bool)
    for i, row in enumerate(values):
        better = np.all(values >= row, axis=1) & np.any(values > row, axis=1)
        kept[i] = not better.any()
    return kept
