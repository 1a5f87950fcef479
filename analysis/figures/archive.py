"""The best design in each cell of a grid over two descriptors, and how the grid filled."""

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from evoros.base.arrays import Array

from ..drawing.cells import MIN_IN, draw_in_cells
from ..drawing.finish import COLOUR_BAR
from ..drawing.gallery import choose_apart, draw_designs
from ..drawing.sheet import Sheet
from ..drawing.style import PAGE_IN, assign_colours, use_style
from ..product import Product
from ..tables.candidates import place_candidates
from ..tables.elites import Archive, Grid, read_archive
from ..tables.measured import add_choice
from ..tables.records import label_fitness
from ..tables.study import Study

FIRST_ROBOT = True
HELP = "the best design for each pair of descriptors, with coverage and QD score over the missions"
DESIGNS, COLUMNS = 6, 2  # drawn beside the map
MAP_IN, PANEL_IN, BELOW_IN = 3.5, 1.02, 1.95
HEIGHT_IN = MAP_IN + BELOW_IN + 0.55


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the descriptors and the number of cells."""
    add_choice(parser)
    about = "cells along each descriptor; those of the optimizer, or 10"
    parser.add_argument("--cells", type=int, metavar="N", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the archive of all runs together; the tables are its elites and its growth."""
    archive = read_archive(study, options)
    (x, y, _), elites = archive.grid, archive.elites
    listed = elites.assign(run=[study.records[place].name for place in elites.place])
    listed = listed.rename(columns={x.column: "x", y.column: "y"})
    listed = listed[["run", "id", "cell_x", "cell_y", "x", "y", "fitness"]]
    tables = {"archive_growth.csv": archive.growth}
    return Product(listed, draw_archive(study, archive), tables=tables)


def draw_archive(study: Study, archive: Archive) -> Figure:
    """Draw the map, some of its designs beside it, and coverage and QD score below."""
    elites = archive.elites
    with use_style():
        sheet = Sheet(PAGE_IN, 1, [], [HEIGHT_IN], bottom=0.0)
        figure = sheet.make_figure()
        chosen = choose_apart(elites[["cell_x", "cell_y"]].to_numpy(float), DESIGNS)
        bottom = BELOW_IN + 0.42
        axes = sheet.add_box(figure, (0.55, bottom), (MAP_IN, MAP_IN))
        bar = sheet.add_box(figure, (0.55 + MAP_IN + 0.08, bottom), (0.09, MAP_IN))
        image = _draw_map(axes, study, archive, chosen)
        figure.colorbar(image, cax=bar).set_label(label_fitness(study.records))
        bar.set_label(COLOUR_BAR)
        left, step = 0.55 + MAP_IN + 0.78, (MAP_IN - PANEL_IN) / 2
        corners = [
            (left + (i % COLUMNS) * (PANEL_IN + 0.08), bottom + (2 - i // COLUMNS) * step - 0.04)
            for i in range(len(chosen))
        ]
        panels = [sheet.add_box(figure, corner, (PANEL_IN, PANEL_IN)) for corner in corners]
        draw_chosen(study, elites, chosen, panels)
        width = (PAGE_IN - 1.55) / 2
        for i, (column, label) in enumerate((("coverage", "coverage"), ("qd_score", "QD score"))):
            place = (0.55 + i * (width + 0.85), 0.45)
            _draw_growth(sheet.add_box(figure, place, (width, 1.25)), archive.growth, column, label)
    return figure


def _draw_map(axes: Axes, study: Study, archive: Archive, chosen: Sequence[int]) -> AxesImage:
    (x, y, cells), elites = archive.grid, archive.elites
    fitness: Array = np.full((cells, cells), np.nan)
    fitness[elites.cell_y, elites.cell_x] = elites.fitness
    frame: dict[str, Any] = {"origin": "lower", "extent": (*x.bounds, *y.bounds)}
    image = axes.imshow(fitness, aspect="auto", cmap="viridis", zorder=1, **frame)
    axes.set_facecolor("0.94")
    axes.set(xlabel=x.label, ylabel=y.label)
    side = np.array([axis.bounds[1] - axis.bounds[0] for axis in (x, y)]) / cells
    centres = _find_centres(elites, archive.grid)
    into = MAP_IN / cells >= MIN_IN
    if into:
        designs = [
            place_candidates(elites.loc[[row]], study.records[int(elites.place[row])])
            for row in elites.index
        ]
        draw_in_cells(axes, centres, side, designs, study.records[0].context)
    corner = np.array([-0.32, 0.32]) if into else np.zeros(2)
    for index, row in enumerate(chosen, start=1):
        mark_number(axes, centres[row] + corner * side, index, size=4 if into else 6)
    return image


def _find_centres(elites: pd.DataFrame, grid: Grid) -> Array:
    """Return the centres (n, 2) of the cells of elites, in the units of the descriptors."""
    *axes, cells = grid
    low, high = np.array([axis.bounds for axis in axes]).T
    places = elites[["cell_x", "cell_y"]].to_numpy(float)
    centres: Array = low + (places + 0.5) / cells * (high - low)
    return centres


def mark_number(
    axes: Axes, at: Array, index: int, offset: tuple[float, float] = (0, 0), size: float = 6
) -> None:
    """Write the number of a design in a white disc."""
    disc = {"boxstyle": "circle,pad=0.15", "fc": "white", "ec": "black", "lw": 0.5}
    style: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "va": "center"}
    axes.annotate(f"{index}", tuple(at), offset, fontsize=size, bbox=disc, zorder=5, **style)


def draw_chosen(
    study: Study, candidates: pd.DataFrame, chosen: Sequence[int], panels: Sequence[Axes]
) -> None:
    """Draw designs of the runs into panels, with their number and fitness above."""
    designs, titles = [], []
    for index, row in enumerate(chosen, start=1):
        record = study.records[int(candidates.place[row])]
        designs.append(place_candidates(candidates.loc[[row]], record))
        titles.append(f"{index}: fitness {candidates.fitness[row]:.1f}")
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
        axes.legend(frameon=False, loc="lower right", fontsize="small")
