"""All champions on one robot: where their sensors are and what they see (the paper's Fig. 8).

Short cones show how places lie on a robot, whole ranges which directions are covered. The shade is
a count, because overlapping translucent cones would not show numbers: of champions, or of the
sensors of single champions.
"""

import argparse
import math
from collections.abc import Mapping, Sequence
from itertools import product

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

from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext

from ..designs.cones import Window, fit_window, robot_length
from ..designs.raster import cell_centres, count_coverage, rasterize
from ..drawing import robot
from ..drawing.champions import Champions
from ..drawing.finish import COLOUR_BAR
from ..drawing.sheet import Sheet
from ..drawing.style import COLUMN_IN, figure_width, is_wide, use_style
from ..drawing.words import wrap_all
from ..product import Product
from ..tables.champions import read_champion
from ..tables.study import Study

ONE_ROBOT = True
HELP = "sensors and cones of the champions on one robot, darker where they coincide (Fig. 8)"
NEEDS = "runs with at least one generation"
FILES = {
    "overlay.csv": "the number of champions that cover each place",
    "overlay_sensors.csv": "the champions' sensors",
    "overlay_signals.csv": "the champions' sensors that see nothing, if there are any",
}
Shades = tuple[ListedColormap, BoundaryNorm]
PER_ROW_IN = 1.5  # minimum width of a panel
LETTERS_PER_IN = 16  # of a title
APART = 2.5
"""Ratio of ranges above which the shorter cones would be specks beside the longer ones."""
BAR_IN = 0.75  # room for the colour bar
HEADS_IN = (0.38, 0.6)  # room above the first view and above the others
LINE_IN = 0.13  # of a title
BAR_LABEL = "whose cones cover a place"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the length of the near view's cones."""
    about = "length of the cones in the near view [m]; about the robot's length"
    parser.add_argument("--cut", type=float, metavar="M", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the champions; the tables are the counts and the sensors."""
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
    """Choose the lengths [m] at which cones are cut: near, and the whole range if longer.

    The shortest cones are shown whole where they are not specks beside the longest ones.
    """
    if near_m is not None and not 0 < near_m < math.inf:
        raise InputError(
            f"--cut: must be a length greater than 0, not {near_m}; set it to 0.5, for example"
        )
    if sensors.x_m.isna().all():
        return ()
    far = float(sensors.range_m.max())
    near = near_m or max(round(max(map(robot_length, contexts.values())), 1), 0.1)
    short = float(sensors.range_m.min())
    cuts = {near, far}
    if near_m is None and near < short < far / APART:
        cuts = {short, far} if short <= APART * near else {near, short, far}
    return tuple(sorted(cut for cut in cuts if cut <= far))


def draw_overlay(cover: pd.DataFrame, champions: Champions, width: float = COLUMN_IN) -> Figure:
    """Draw a panel for each treatment and cut: the robot, the sensors, and what they cover.

    ``cover`` is from ``count_coverage``; ``width`` is in inches.
    """
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
            how = "whole cones," if view == len(views) - 1 else "cones cut at"
            cones = f"{how} {cut:g} m" if cut else "no sensors"
            title = cones if view else f"{titles[treatment]}\n{cones}"
            axes.set_title(title, loc="left", fontsize="small")
            robot.frame_axes(axes, views[view])
        _add_legends(figure, page, shades, cover.columns[-1], handles)
    return figure


def _shades(maximum: int) -> Shades:
    """Return a shade for each count from 1 to ``maximum``, monotone in grey."""
    cmap = ListedColormap(mpl.colormaps["YlGnBu"](np.linspace(0.15, 1.0, 256)))
    return cmap, BoundaryNorm(np.arange(0.5, maximum + 1), cmap.N)


def _lay_out(
    treatments: int, views: Sequence[Window], width: float, with_legend: bool, lines: int
) -> tuple[Sheet, bool]:
    """Place treatments side by side, and their views below each other, or beside (second value).

    ``lines`` counts those above the first view that are not always there.
    """
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
    """Count the treatments beside each other, in rows of equal length."""
    most = max(1, min(treatments, int((width - BAR_IN) / PER_ROW_IN)))
    return math.ceil(treatments / math.ceil(treatments / most))


def _draw_counts(
    axes: Axes, context: FigureContext, cover: pd.DataFrame, view: Window, shades: Shades
) -> None:
    """Draw the counts between the robot and its edges."""
    robot.draw_robot(axes, context)
    robot.draw_robot(axes, context, fill=False, zorder=3)
    if cover.empty:
        return
    half = float(cover.cell_m.iloc[0]) / 2
    x, y = cell_centres(view, 2 * half)
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
    bar.set_label(f"{unit}{chr(10) if height < 2 else chr(32)}{BAR_LABEL}")
    bar.ax.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    bar.ax.tick_params(labelsize="small", length=2)
    bar.ax.minorticks_off()
    if handles:
        columns = 6 if is_wide(page.width) else 3
        figure.legend(handles=handles, loc="lower left", ncols=columns, frameon=False)
