"""The best design in each cell of a grid over two descriptors, and the front of two objectives."""

import argparse
from typing import NamedTuple

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.base.errors import InputError

from .measured import (
    DESCRIPTORS,
    OBJECTIVES,
    Axis,
    choose_axes,
    count_missions,
    read_axes,
    read_measured,
    take_latest,
)
from .study import Study

MOST_CELLS = 1000
Grid = tuple[Axis, Axis, int]
"""Two descriptors, and the number of cells along each."""


class Archive(NamedTuple):
    """The archive of all runs of a study together."""

    grid: Grid
    elites: pd.DataFrame  # the fittest first; ``place`` is the index of their run
    growth: pd.DataFrame  # of each run by its generations


class Front(NamedTuple):
    """The front of all runs of a study together, in two of its objectives."""

    x: Axis
    y: Axis
    candidates: pd.DataFrame  # all of them; ``place`` is the index of their run
    front: pd.DataFrame  # in the order of both objectives


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
    candidates = pd.concat(
        [take_latest(table).assign(place=place) for place, table in enumerate(tables)]
    )
    growth = pd.concat(
        [
            trace_growth(table, count_missions(record), grid).assign(run=record.name)
            for record, table in zip(study.records, tables, strict=True)
        ],
        ignore_index=True,
    )
    return Archive(grid, find_elites(candidates, grid), growth)


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
    """Read the front in all objectives; ``options`` choose two, ``x`` and ``y``, that are drawn."""
    x, y = choose_axes(study, OBJECTIVES, options)
    axes = read_axes(study.records[0], OBJECTIVES)
    candidates = pd.concat(
        [
            take_latest(read_measured(record, axes)).assign(place=place)
            for place, record in enumerate(study.records)
        ],
        ignore_index=True,
    )
    values = np.column_stack([axis.sign * candidates[axis.column] for axis in axes])
    front = candidates[find_front(values)].sort_values([x.column, y.column], ignore_index=True)
    return Front(x, y, candidates, front)


def find_front(values: Array) -> Array:
    """Return which rows of (n, objectives), all maximized, no other one dominates."""
    kept = np.ones(len(values), dtype=bool)
    for i, row in enumerate(values):
        better = np.all(values >= row, axis=1) & np.any(values > row, axis=1)
        kept[i] = not better.any()
    return kept
