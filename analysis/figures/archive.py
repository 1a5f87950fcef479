"""The best design per cell of a grid over two descriptors, and the growth of the archive."""

import argparse
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D

from evoros.base.arrays import Array

from ..drawing.finish import COLOUR_BAR
from ..drawing.gallery import MIN_IN, choose_apart, draw_designs, draw_growth, draw_in_cells
from ..drawing.sheet import Sheet
from ..drawing.style import PAGE_IN, assign_colours, figure_width, is_wide, use_style, wrap
from ..subcommands import Product
from ..tables.designs import place_candidates
from ..tables.elites import Archive, Grid, add_choice, read_archive
from ..tables.records import label_fitness
from ..tables.study import Study
from .options import RUN, add_grouping, group_runs

FIRST_ROBOT = True
HELP = "the best design in each cell of two descriptors; growth of coverage and QD score"
NEEDS = "runs that recorded at least two descriptors"
FILES = ("archive.csv", "archive_growth.csv")
DESIGNS, COLUMNS = 6, 2  # numbers of designs next to a single map, and of their columns
MOST_COLUMNS = 5  # maximum number of maps per row
MAP_IN, PANEL_IN, BELOW_IN = 3.5, 1.02, 1.95
STEP_IN = 1.28  # height [in] of a design row below the map
LINE_IN = 0.14
LETTERS = 90  # title characters per row of maps


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for descriptors, number of cells and grouping of runs."""
    add_choice(parser)
    about = "number of cells along each descriptor; default: the optimizer's number, or 10"
    parser.add_argument("--cells", type=int, metavar="N", help=about)
    add_grouping(parser)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the archive of each treatment or run; tables list the elites and the growth."""
    archive = read_archive(study, options)
    x, y, _ = archive.grid
    groups = group_runs(study, options.by)
    elites = {name: archive.select_elites(runs) for name, runs in groups.items()}
    listed = pd.concat(list(elites.values()), ignore_index=True)
    listed = listed.rename(columns={x.column: "x", y.column: "y"})
    columns = ["run", "treatment", "id", "cell_x", "cell_y", "x", "y", "fitness"]
    figure = _draw_archives(study, archive, elites, options.by, figure_width(options.columns, 2))
    return Product(listed[columns], figure, tables={"archive_growth.csv": archive.growth})


def _draw_archives(
    study: Study, archive: Archive, elites: Mapping[str, pd.DataFrame], by: str, width: float
) -> Figure:
    wide = is_wide(width)
    growth_in = BELOW_IN if wide else 2 * BELOW_IN - 0.1  # side by side, or one above the other
    with use_style():
        titles = _make_titles(study, elites, by)
        treatments = study.treatments
        legend = LINE_IN * len(treatments) if len(treatments) > 1 else 0.0
        if len(elites) == 1:
            gallery = 0.0 if wide else 2 * STEP_IN
            height = _size_map(width) + 0.55 + gallery + growth_in + legend
            sheet = Sheet(width, 1, [], [height], bottom=0.0)
            figure = sheet.make_figure()
            ((name, alone),) = elites.items()
            _draw_alone(figure, sheet, study, archive, (alone, titles[name]))
        else:
            sheet = _lay_out(width, titles, growth_in + legend)
            figure = sheet.make_figure()
            _draw_side_by_side(figure, sheet, study, archive, elites, titles)
        size = ((width - 1.55) / 2 if wide else width - 0.65, 1.25)
        for i, (column, label) in enumerate((("coverage", "coverage"), ("qd_score", "QD score"))):
            across, up = (i * (size[0] + 0.85), 0.0) if wide else (0.0, (1 - i) * (BELOW_IN - 0.1))
            axes = sheet.add_box(figure, (0.55 + across, 0.45 + legend + up), size)
            draw_growth(axes, archive.growth, treatments, by != RUN, column)
            axes.set_ylabel(label)
        if legend:
            colours = assign_colours(treatments).items()
            lines = [Line2D([], [], color=colour, lw=1.2, label=name) for name, colour in colours]
            figure.legend(handles=lines, loc="lower left", frameon=False)
    return figure


def _make_titles(study: Study, elites: Mapping[str, pd.DataFrame], by: str) -> dict[str, str]:
    if by == RUN:
        return {r.name: f"{r.treatment}, seed {r.seed}" for r in study.records}
    counts = Counter(record.treatment for record in study.records)
    return {
        name: name if counts[name] == 1 else f"{name}: best of {counts[name]} runs"
        for name in elites
    }


def _size_map(width: float) -> float:
    return MAP_IN if is_wide(width) else width - 1.45


def _lay_out(width: float, titles: Mapping[str, str], below: float) -> Sheet:
    count = len(titles)
    columns = count if count <= 3 else min(MOST_COLUMNS, math.ceil(math.sqrt(count)))
    columns = columns if is_wide(width) else 1
    rows = math.ceil(count / columns)
    lines = max(
        wrap(title, LETTERS * width / PAGE_IN / columns).count("\n") for title in titles.values()
    )
    heads = [0.25 + LINE_IN * lines + (0.42 if row else 0.0) for row in range(rows)]
    return Sheet(width, columns, [1.0] * rows, heads, right=0.95, bottom=below + 0.42, gap=0.3)


def _draw_side_by_side(
    figure: Figure,
    sheet: Sheet,
    study: Study,
    archive: Archive,
    elites: Mapping[str, pd.DataFrame],
    titles: Mapping[str, str],
) -> None:
    fitness = pd.concat([table.fitness for table in elites.values()])
    scale = Normalize(fitness.min(), fitness.max())
    for i, (name, table) in enumerate(elites.items()):
        row, column = divmod(i, sheet.columns)
        axes = sheet.add_panel(figure, row, column)
        image = _draw_map(axes, study, archive, table, (sheet.panel, scale))
        room = LETTERS * sheet.width / PAGE_IN / sheet.columns
        axes.set_title(wrap(titles[name], room), fontsize="small")
        if i + sheet.columns < len(elites):
            axes.set_xlabel("")
        if column:
            axes.set(ylabel="", yticklabels=[])
    top = sheet.height - sheet.heads[0]
    box = sheet.add_box(
        figure, (sheet.width - sheet.right + 0.15, top - sheet.panel), (0.09, sheet.panel)
    )
    _add_colours(figure, image, box, study)


def _draw_alone(
    figure: Figure, sheet: Sheet, study: Study, archive: Archive, shown: tuple[pd.DataFrame, str]
) -> None:
    elites, title = shown
    chosen = choose_apart(elites[["cell_x", "cell_y"]].to_numpy(float), DESIGNS)
    map_in = _size_map(sheet.width)
    bottom = sheet.height - map_in - 0.13
    axes = sheet.add_box(figure, (0.55, bottom), (map_in, map_in))
    image = _draw_map(axes, study, archive, elites, (map_in, None))
    into = map_in / archive.grid[2] >= MIN_IN
    side = _measure_cells(archive.grid)
    corner = np.array([-0.32, 0.32]) if into else np.zeros(2)
    centres = _find_centres(elites, archive.grid)
    for index, row in enumerate(chosen, start=1):
        mark_number(axes, centres[row] + corner * side, index, size=4 if into else 6)
    if len(study.records) > 1:
        axes.set_title(title, fontsize="small", pad=2)
    _add_colours(
        figure, image, sheet.add_box(figure, (0.63 + map_in, bottom), (0.09, map_in)), study
    )
    columns, left, top = COLUMNS, 0.55 + MAP_IN + 0.78, sheet.height - PANEL_IN - 0.17
    step = (MAP_IN - PANEL_IN) / 2
    if not is_wide(sheet.width):
        columns, left, top, step = 3, 0.15, bottom - PANEL_IN - 0.7, STEP_IN
    corners = [
        (left + (i % columns) * (PANEL_IN + 0.08), top - (i // columns) * step)
        for i in range(len(chosen))
    ]
    panels = [sheet.add_box(figure, corner, (PANEL_IN, PANEL_IN)) for corner in corners]
    draw_chosen(study, elites, chosen, panels)


def _add_colours(figure: Figure, image: AxesImage, box: Axes, study: Study) -> None:
    figure.colorbar(image, cax=box).set_label(label_fitness(study.records))
    box.set_label(COLOUR_BAR)


def _draw_map(
    axes: Axes,
    study: Study,
    archive: Archive,
    elites: pd.DataFrame,
    size: tuple[float, Normalize | None],
) -> AxesImage:
    x, y, cells = archive.grid
    fitness: Array = np.full((cells, cells), np.nan)
    fitness[elites.cell_y, elites.cell_x] = elites.fitness
    frame: dict[str, Any] = {"origin": "lower", "extent": (*x.bounds, *y.bounds)}
    image = axes.imshow(fitness, aspect="auto", cmap="viridis", norm=size[1], zorder=1, **frame)
    axes.set_facecolor("0.94")
    axes.set(xlabel=wrap(x.label, 14 * size[0]), ylabel=wrap(y.label, 14 * size[0]))
    if size[0] / cells >= MIN_IN:
        designs = [
            place_candidates(elites.loc[[row]], study.records[int(elites.place[row])])
            for row in elites.index
        ]
        centres = _find_centres(elites, archive.grid)
        context = study.records[0].context
        draw_in_cells(axes, centres, _measure_cells(archive.grid), designs, context)
    return image


def _measure_cells(grid: Grid) -> Array:
    x, y, cells = grid
    return np.array([axis.bounds[1] - axis.bounds[0] for axis in (x, y)]) / cells


def _find_centres(elites: pd.DataFrame, grid: Grid) -> Array:
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
    """Draw the chosen designs in panels titled with number and fitness."""
    designs, titles = [], []
    unit = study.records[0].context.fitness.unit
    for index, row in enumerate(chosen, start=1):
        record = study.records[int(candidates.place[row])]
        designs.append(place_candidates(candidates.loc[[row]], record))
        value = f"{candidates.fitness[row]:.4g}"
        titles.append(f"{index}: {value} {unit}" if unit else f"{index}: fitness {value}")
    draw_designs(panels, titles, designs, study.records[0].context)
