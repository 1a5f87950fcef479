"""All champions on one robot: positions and coverage of the sensors (Fig. 8 of the paper).

The shade shows the number of champions, or of sensors if every treatment has a single champion.
"""

import argparse
import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext

from ..designs.cones import Window, find_covered, fit_window, robot_length
from ..drawing import robot
from ..drawing.finish import COLOUR_BAR
from ..drawing.robot import Champions
from ..drawing.sheet import Sheet
from ..drawing.style import COLUMN_IN, figure_width, is_wide, use_style, wrap_all
from ..subcommands import Product
from ..tables.champions import read_champion
from ..tables.study import Study

ONE_ROBOT = True
HELP = "sensors and cones of the champions on one robot, darker where they overlap (Fig. 8)"
NEEDS = "runs with at least one generation"
FILES = ("overlay.csv", "overlay_sensors.csv", "overlay_signals.csv")
Shades = tuple[ListedColormap, BoundaryNorm]
PER_ROW_IN, CROWDED_IN = 1.5, 1.2  # minimum panel width [in], for one treatment and for several
LETTERS_PER_IN = 16  # characters per inch of titles
APART = 2.5  # ratio of ranges above which shorter cones would look like dots
BAR_IN = 0.75  # space [in] for the colour bar
HEADS_IN = (0.38, 0.6)  # space above the first view, and above other views
LINE_IN = 0.13  # height of a title line
BAR_LABEL = "covering the point"
CELLS = 300  # number of cells along a cone, about 0.1 mm each in print
SPAN = ["treatment", "cut_m", "cell_m", "x_m", "y_low_m", "y_high_m"]
UNITS = {"champions": ["run"], "sensors": ["run", "sensor"]}  # columns that identify a unit


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--cut``, the cone length in the near view."""
    about = "length of the cones in the near view [m]; default: about the robot's length"
    parser.add_argument("--cut", type=float, metavar="M", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the champions; tables list the counts and the sensors."""
    sensors = study.gather(read_champion)
    contexts = {
        record.treatment: record.context
        for record in study.records
        if record.treatment in set(sensors.treatment)
    }
    cover = count_coverage(sensors, contexts, choose_cuts(sensors, contexts, options.cut))
    width = figure_width(options.columns, 1 if len(contexts) == 1 else 2)
    unfinished = [record.name for record in study.records if not record.finished]
    figure = draw_overlay(cover, Champions(sensors, contexts, study.signals, unfinished), width)
    tables = {"overlay_sensors.csv": sensors}
    if len(study.signals):
        tables["overlay_signals.csv"] = study.signals
    return Product(cover, figure, tables=tables)


def choose_cuts(
    sensors: pd.DataFrame, contexts: Mapping[str, FigureContext], near_m: float | None = None
) -> tuple[float, ...]:
    """Return the lengths [m] at which cones are cut off: a near length, and the full range."""
    if near_m is not None and not 0 < near_m < math.inf:
        raise InputError(
            f"--cut: must be a positive length, not {near_m}; type --cut 0.5, for example"
        )
    if sensors.x_m.isna().all():
        return ()
    far = float(sensors.range_m.max())
    near = near_m or max(round(max(map(robot_length, contexts.values())), 1), 0.1)
    short = float(sensors.range_m.min())
    cuts = {near, far}
    if near_m is None and near < short < far / APART:  # short cones would look like dots
        cuts = {short, far} if short <= APART * near else {near, short, far}
    return tuple(sorted(cut for cut in cuts if cut <= far))


def draw_overlay(cover: pd.DataFrame, champions: Champions, width: float = COLUMN_IN) -> Figure:
    """Draw a panel per treatment and cut with the robot, its sensors, and their coverage."""
    contexts = champions.contexts
    cuts_m = sorted(cover.cut_m.unique()) or [0.0]
    views = [fit_window(contexts.values(), champions.placed, cut) for cut in cuts_m]
    shades = _shades(int(max([int(champions.numbers.max()), *cover.iloc[:, -1]])))
    with use_style():
        handles = champions.make_handles()
        room = LETTERS_PER_IN * (width - BAR_IN) / _count_columns(len(contexts), width)
        titles = {
            treatment: wrap_all(champions.describe(treatment).split("\n"), room, 12)
            for treatment in contexts
        }
        lines = max(title.count("\n") for title in titles.values())
        page, side_by_side = _lay_out(len(contexts), views, width, bool(handles), lines)
        figure = page.make_figure()
        for (i, treatment), (view, cut) in product(enumerate(contexts), enumerate(cuts_m)):
            row, column = divmod(i, page.columns)
            place = (0, view) if side_by_side else (row * len(views) + view, column)
            axes = page.add_panel(figure, *place)
            axes.set(xlabel=robot.AXES[0], ylabel="" if place[1] else robot.AXES[1])
            shown = cover[(cover.treatment == treatment) & (cover.cut_m == cut)]
            _draw_counts(axes, contexts[treatment], shown, views[view], shades)
            champions.draw_on_each_other(axes, treatment, cut, places=view == 0)
            reach = champions.placed.range_m[champions.placed.treatment == treatment].max()
            how = f"whole cones, {reach:g} m" if reach <= cut else f"cones cut at {cut:g} m"
            cones = "no sensors" if np.isnan(reach) else how
            title = cones if view else f"{titles[treatment]}\n{cones}"
            axes.set_title(title, loc="left", fontsize="small")
            robot.frame_axes(axes, views[view])
        _add_legends(figure, page, shades, cover.columns[-1], handles)
    return figure


def _shades(maximum: int) -> Shades:
    cmap = ListedColormap(mpl.colormaps["YlGnBu"](np.linspace(0.15, 1.0, 256)))
    return cmap, BoundaryNorm(np.arange(0.5, maximum + 1), cmap.N)


def _lay_out(
    treatments: int, views: Sequence[Window], width: float, with_legend: bool, lines: int
) -> tuple[Sheet, bool]:
    """Return the sheet, and True if its views are side by side instead of stacked."""
    first = HEADS_IN[0] + lines * LINE_IN
    bottom = 0.6 if with_legend else 0.4
    ratios = [robot.aspect_ratio(view) for view in views]
    if treatments == 1 and width > 2 * PER_ROW_IN + COLUMN_IN / 2:
        heights, heads, columns, gap = [max(ratios)], [first], len(views), 0.55
        return Sheet(width, columns, heights, heads, right=BAR_IN, bottom=bottom, gap=gap), True
    columns = _count_columns(treatments, width)
    blocks = math.ceil(treatments / columns)
    heads = [first, *(HEADS_IN[1] for _ in views[1:])]
    heads += [heads[0] + 0.35, *heads[1:]] * (blocks - 1)
    heights = ratios * blocks
    return Sheet(width, columns, heights, heads, right=BAR_IN, bottom=bottom, gap=0.3), False


def _count_columns(treatments: int, width: float) -> int:
    panel = PER_ROW_IN if treatments < 3 else CROWDED_IN
    most = max(1, min(treatments, int((width - BAR_IN) / panel)))
    return math.ceil(treatments / math.ceil(treatments / most))


def _draw_counts(
    axes: Axes, context: FigureContext, cover: pd.DataFrame, view: Window, shades: Shades
) -> None:
    robot.draw_robot(axes, context)
    robot.draw_robot(axes, context, 0.5, order=3)  # wheels remain visible through cones
    if cover.empty:
        return
    half = float(cover.cell_m.iloc[0]) / 2
    x, y = _cell_centres(view, 2 * half)
    axes.imshow(
        rasterize(cover, x, y),
        origin="lower",
        extent=(y[0] - half, y[-1] + half, x[0] - half, x[-1] + half),
        cmap=shades[0],
        norm=shades[1],
        interpolation="nearest",
        zorder=2,
    )


def _add_legends(
    figure: Figure, page: Sheet, shades: Shades, unit: str, handles: Sequence[Line2D | Patch]
) -> None:
    height = min(0.8 * (page.height - page.bottom), 3.0)
    corner = page.width - page.right + 0.15, (page.height - height) / 2
    box = page.add_box(figure, corner, (0.1, height))
    box.set_label(COLOUR_BAR)
    bar = figure.colorbar(ScalarMappable(shades[1], shades[0]), cax=box)
    bar.set_label(f"{unit} {BAR_LABEL}")
    bar.ax.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    bar.ax.tick_params(labelsize="small", length=2)
    bar.ax.minorticks_off()
    if handles:
        columns = 6 if is_wide(page.width) else 3
        figure.legend(handles=handles, loc="lower left", ncols=columns, frameon=False)


def count_coverage(
    sensors: pd.DataFrame, contexts: Mapping[str, FigureContext], cuts_m: Sequence[float]
) -> pd.DataFrame:
    """Count the champions or, with one per treatment, the sensors that cover each point."""
    several = sensors.groupby("treatment").run.nunique().max() > 1
    unit = "champions" if several else "sensors"
    placed = sensors.dropna(subset="x_m")
    spans = [
        _spans(placed[placed.treatment == treatment], context, cut, unit).assign(
            treatment=treatment
        )
        for treatment, context in contexts.items()
        for cut in cuts_m
    ]
    order = [*SPAN, unit]
    return pd.concat(spans, ignore_index=True)[order] if spans else pd.DataFrame(columns=order)


def _spans(sensors: pd.DataFrame, context: FigureContext, cut: float, unit: str) -> pd.DataFrame:
    cell = cut / CELLS
    x, y = _cell_centres(fit_window([context], sensors, cut), cell)
    along, across = np.meshgrid(x, y, indexing="ij")
    count = np.zeros((len(x), len(y)), dtype=np.int64)
    for _, members in sensors.groupby(UNITS[unit]):
        count += find_covered(members, along, across, cell, cut).astype(np.int64)
    edges = np.pad(count, ((0, 0), (1, 1)))
    row, first = np.nonzero(edges[:, 1:] != edges[:, :-1])  # cells at which the count changes
    last = np.where(np.diff(row, append=-1), 0, np.roll(first, -1))
    span = last > first
    row, first, last = row[span], first[span], last[span]
    table = {"cut_m": cut, "cell_m": cell, "x_m": x[row], unit: count[row, first]}
    low, high = (y[0] + (end - 0.5) * cell for end in (first, last))
    spans = pd.DataFrame(table | {"y_low_m": low.round(9), "y_high_m": high.round(9)})
    return spans[spans[unit] > 0]


def _cell_centres(view: Window, cell_m: float) -> tuple[Array, Array]:
    """Return the centres [m] of the cells in a window; cell borders pass through the axes."""
    x_low, x_high, y_low, y_high = (edge / cell_m for edge in view)
    x = np.arange(math.floor(x_low), math.ceil(x_high), dtype=np.float64)
    y = np.arange(math.floor(y_low), math.ceil(y_high), dtype=np.float64)
    return ((x + 0.5) * cell_m).round(9), ((y + 0.5) * cell_m).round(9)


def rasterize(cover: pd.DataFrame, x: Array, y: Array) -> np.ma.MaskedArray[Any, Any]:
    """Return the counts (n, m) at cell centres x (n,), y (m,) [m]; zeros are masked."""
    cell = float(cover.cell_m.iloc[0])
    count = np.zeros((len(x), len(y)), dtype=np.int64)
    rows = np.rint((cover.x_m - x[0]) / cell).astype(int)
    low, high = (
        np.rint((cover[end] - y[0]) / cell + 0.5).astype(int) for end in ("y_low_m", "y_high_m")
    )
    for row, first, last, units in zip(rows, low, high, cover.iloc[:, -1], strict=True):
        count[row, first:last] = units
    masked: np.ma.MaskedArray[Any, Any] = np.ma.masked_equal(count, 0)
    return masked
