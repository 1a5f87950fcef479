"""The designs that no other one exceeds in all objectives, drawn beside their front."""

import argparse

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evoros.base.arrays import Array

from ..drawing.gallery import choose_apart
from ..drawing.sheet import Sheet
from ..drawing.style import BLUE, PAGE_IN, VERMILLION, use_style
from ..product import Product
from ..tables.elites import Front, read_front
from ..tables.measured import Axis, add_choice
from ..tables.study import Study
from .archive import draw_chosen, mark_number

FIRST_ROBOT = True
HELP = "the front of two objectives, with some of its designs drawn beside it"
DESIGNS, COLUMNS = 6, 3  # drawn beside the front
HEIGHT_IN, PLOT_IN = 3.1, 2.75


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the objectives."""
    add_choice(parser)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the front of all runs together; the table is the front."""
    shown = read_front(study, options)
    front = shown.front
    listed = front.assign(run=[study.records[place].name for place in front.place])
    listed = listed.assign(x=front[shown.x.column], y=front[shown.y.column])
    return Product(listed[["run", "id", "x", "y", "fitness"]], draw_front(study, shown))


def draw_front(study: Study, shown: Front) -> Figure:
    """Draw all candidates, their front, and some of its designs beside it."""
    x, y, candidates, front = shown
    with use_style():
        sheet = Sheet(PAGE_IN, 1, [], [HEIGHT_IN], bottom=0.0)
        figure = sheet.make_figure()
        axes = sheet.add_box(figure, (0.68, 0.42), (PLOT_IN, HEIGHT_IN - 0.6))
        points = front[[x.column, y.column]].to_numpy(float)
        chosen = sorted(choose_apart(points, DESIGNS))
        _draw_points(axes, candidates, points, x, y)
        for index, row in enumerate(chosen, start=1):
            mark_number(axes, points[row], index, (5.5 * x.sign, 5.5 * y.sign))
        left, size = 0.68 + PLOT_IN + 0.3, 1.05
        corners = [
            (left + (i % COLUMNS) * (size + 0.04), HEIGHT_IN - 1.35 - (i // COLUMNS) * 1.38)
            for i in range(len(chosen))
        ]
        panels = [sheet.add_box(figure, corner, (size, size)) for corner in corners]
        draw_chosen(study, front, chosen, panels)
    return figure


def _draw_points(axes: Axes, candidates: pd.DataFrame, points: Array, x: Axis, y: Axis) -> None:
    places = candidates[x.column], candidates[y.column]
    axes.scatter(*places, s=6, color="0.7", linewidths=0, label="evaluated", zorder=1)
    corner = "steps-post" if x.sign < 0 else "steps-pre"
    across, up = points[:, 0], points[:, 1]
    axes.plot(across, up, color=BLUE, lw=0.8, ds=corner, zorder=2)
    axes.scatter(across, up, s=14, color=VERMILLION, linewidths=0, label="front", zorder=3)
    better = {1.0: "more is better", -1.0: "less is better"}
    axes.set(xlabel=f"{x.label} ({better[x.sign]})", ylabel=f"{y.label} ({better[y.sign]})")
    axes.margins(0.08)
    axes.legend(frameon=False, loc="best", handletextpad=0.2)
