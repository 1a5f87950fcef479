"""The best design in each cell of a grid over two descriptors, and how the grid filled."""

import argparse
from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evoros.base.arrays import Array
from evoros.base.errors import InputError

from ..drawing.gallery import choose_apart, draw_designs
from ..drawing.sheet import Sheet
from ..drawing.style import PAGE_IN, STYLE, assign_colours
from ..product import Product
from ..tables.candidates import place_candidates
from ..tables.measured import (
    DESCRIPTORS,
    Axis,
    add_choice,
    choose_axes,
    count_missions,
    read_measured,
    take_latest,
)
from ..tables.study import Study

FIRST_ROBOT = True
HELP = "the best design for each pair of descriptors, with coverage and QD score over the missions"
DESIGNS, COLUMNS = 6, 3  # drawn beside the map
HEIGHT_IN, MAP_IN = 5.1, 2.55
Grid = tuple[Axis, Axis, int]
"""Two descriptors, and the number of cells along each."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the descriptors and the number of cells."""
    add_choice(parser)
    about = "cells along each descriptor; those of the optimizer, or 10"
    parser.add_argument("--cells", type=int, metavar="N", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the archive of all runs together; the tables are its elites and its growth."""
    x, y = choose_axes(study, DESCRIPTORS, options)
    cells = options.cells or int(study.records[0].values.get("optimizer.cells", 10))
    if not 1 <= cells <= 1000:
        raise InputError(f"--cells: must be a number from 1 to 1000, not {cells}; set it to 10")
    grid = (x, y, cells)
    tables = [read_measured(record, (x, y)) for record in study.records]
    candidates = pd.concat(
        [take_latest(table).assign(place=place) for place, table in enumerate(tables)]
    )
    elites = find_elites(candidates, grid)
    growth = pd.concat(
        [
            trace_growth(table, count_missions(record), grid).assign(run=record.name)
            for record, table in zip(study.records, tables, strict=True)
        ],
        ignore_index=True,
    )
    listed = elites.assign(run=[study.records[place].name for place in elites.place])
    listed = listed.rename(columns={x.column: "x", y.column: "y"})
    listed = listed[["run", "id", "cell_x", "cell_y", "x", "y", "fitness"]]
    figure = draw_archive(study, elites, growth, grid)
    return Product(
        listed, figure, files={"archive_growth.csv": growth.to_csv(index=False).encode()}
    )


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
    for number, count in missions.items():
        elites = find_elites(take_latest(table[table.generation <= number]), grid)
        row = {"generation": number, "missions": count, "coverage": len(elites) / grid[2] ** 2}
        rows.append({**row, "qd_score": float(elites.fitness.sum())})
    return pd.DataFrame(rows)


def draw_archive(study: Study, elites: pd.DataFrame, growth: pd.DataFrame, grid: Grid) -> Figure:
    """Draw the map, some of its designs beside it, and coverage and QD score below."""
    with mpl.rc_context(STYLE):
        sheet = Sheet(PAGE_IN, 1, [], [HEIGHT_IN], bottom=0.0)
        figure = sheet.make_figure()
        chosen = choose_apart(elites[["cell_x", "cell_y"]].to_numpy(float), DESIGNS)
        bottom = HEIGHT_IN - MAP_IN - 0.15
        axes = sheet.add_box(figure, (0.55, bottom), (MAP_IN, MAP_IN))
        bar = sheet.add_box(figure, (0.55 + MAP_IN + 0.08, bottom), (0.09, MAP_IN))
        _draw_map(figure, axes, bar, elites, grid, chosen)
        left, size = 0.55 + MAP_IN + 0.72, 1.0
        corners = [
            (left + (i % COLUMNS) * (size + 0.04), bottom + MAP_IN - 1.18 - (i // COLUMNS) * 1.33)
            for i in range(len(chosen))
        ]
        panels = [sheet.add_box(figure, corner, (size, size)) for corner in corners]
        draw_chosen(study, elites, chosen, panels)
        width = (PAGE_IN - 1.55) / 2
        for i, (column, label) in enumerate((("coverage", "coverage"), ("qd_score", "QD score"))):
            place = (0.55 + i * (width + 0.85), 0.42)
            _draw_growth(sheet.add_box(figure, place, (width, 1.25)), growth, column, label)
    return figure


def _draw_map(
    figure: Figure, axes: Axes, bar: Axes, elites: pd.DataFrame, grid: Grid, chosen: Sequence[int]
) -> None:
    x, y, cells = grid
    fitness: Array = np.full((cells, cells), np.nan)
    fitness[elites.cell_y, elites.cell_x] = elites.fitness
    extent = (*x.bounds, *y.bounds)
    image = axes.imshow(
        fitness, origin="lower", extent=extent, aspect="auto", cmap="viridis", zorder=1
    )
    axes.set_facecolor("0.94")
    axes.set(xlabel=x.label, ylabel=y.label)
    low, high = (np.array([axis.bounds[0] for axis in (x, y)]), [a.bounds[1] for a in (x, y)])
    for number, row in enumerate(chosen, start=1):
        place = elites.loc[row, ["cell_x", "cell_y"]].to_numpy(float)
        at = low + (place + 0.5) / cells * (np.array(high) - low)
        mark_number(axes, at, number)
    figure.colorbar(image, cax=bar).set_label("fitness")


def mark_number(axes: Axes, at: Array, number: int, offset: tuple[float, float] = (0, 0)) -> None:
    """Write the number of a design in a white disc."""
    axes.annotate(
        f"{number}",
        tuple(at),
        offset,
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=6,
        bbox={"boxstyle": "circle,pad=0.15", "fc": "white", "ec": "black", "lw": 0.5},
        zorder=5,
    )


def draw_chosen(
    study: Study, candidates: pd.DataFrame, chosen: Sequence[int], panels: Sequence[Axes]
) -> None:
    """Draw designs of the runs into panels, with their number and fitness above."""
    designs, titles = [], []
    for number, row in enumerate(chosen, start=1):
        record = study.records[int(candidates.place[row])]
        designs.append(place_candidates(candidates.loc[[row]], record))
        titles.append(f"{number}: fitness {candidates.fitness[row]:.1f}")
    draw_designs(panels, titles, designs, study.records[0].context)


def _draw_growth(axes: Axes, growth: pd.DataFrame, column: str, label: str) -> None:
    runs = list(dict.fromkeys(growth.run))
    for run, colour in assign_colours(runs).items():
        rows = growth[growth.run == run]
        axes.plot(rows.missions, rows[column], color=colour, lw=1.2, label=run, marker=".", ms=3)
    axes.set(xlabel="missions", ylabel=label)
    axes.set_ylim(bottom=0)
    axes.set_xlim(left=0)
    if len(runs) > 1 and column == "coverage":
        axes.legend(frameon=False, loc="lower right", fontsize=6)
