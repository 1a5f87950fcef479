"""The Pareto front of two objectives, with some of its designs."""

import argparse
from collections.abc import Mapping
from itertools import cycle
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..drawing.gallery import choose_apart
from ..drawing.sheet import Sheet
from ..drawing.style import VERMILLION, assign_colours, figure_width, is_wide, use_style, wrap
from ..subcommands import Product
from ..tables.elites import Axis, Front, add_choice, read_front
from ..tables.study import Study
from .archive import draw_chosen, mark_number
from .options import add_grouping, group_runs

FIRST_ROBOT = True
HELP = "the Pareto front of two objectives, with some of its designs"
NEEDS = "runs that recorded at least two objectives"
FILES = ("front.csv",)
DESIGNS, COLUMNS = 6, 3  # number of designs drawn next to the front, in columns
HEIGHT_IN, PLOT_IN, LINE_IN, STEP_IN = 3.25, 2.65, 0.14, 1.38
LEFT_IN, BOTTOM_IN = 0.8, 0.56  # space for two-line labels
LETTERS = 42  # maximum number of characters per line of a label
MARKERS = "os^Dvp"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for objectives and grouping of runs."""
    add_choice(parser)
    add_grouping(parser)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the Pareto front of each treatment or run; the table lists the designs on it."""
    shown = read_front(study, options)
    groups = group_runs(study, options.by)
    fronts = {name: shown.select_front(runs) for name, runs in groups.items()}
    front = pd.concat(list(fronts.values()), ignore_index=True)
    listed = front.assign(x=front[shown.x.column], y=front[shown.y.column])
    columns = ["run", "treatment", "id", "x", "y", "fitness"]
    width = figure_width(options.columns, 2)
    return Product(listed[columns], _draw_front(study, shown, fronts, front, width))


def _draw_front(
    study: Study,
    shown: Front,
    fronts: Mapping[str, pd.DataFrame],
    front: pd.DataFrame,
    width: float,
) -> Figure:
    """Draw the front, with designs to the right or, in a single column, below."""
    x, y, wide = shown.x, shown.y, is_wide(width)
    with use_style():
        below = LINE_IN * (1 + len(study.treatments)) if len(study.treatments) > 1 else 0.0
        base = below if wide else below + 2 * STEP_IN
        sheet = Sheet(width, 1, [], [HEIGHT_IN + base], bottom=0.0)
        figure = sheet.make_figure()
        plot = PLOT_IN if wide else width - LEFT_IN - 0.12
        axes = sheet.add_box(
            figure, (LEFT_IN, BOTTOM_IN + base), (plot, HEIGHT_IN - BOTTOM_IN - 0.18)
        )
        points = front[[x.column, y.column]].to_numpy(float)
        chosen = sorted(choose_apart(points, DESIGNS))
        _draw_candidates(axes, shown)
        _draw_fronts(axes, study, fronts, x, y)
        if below:
            figure.legend(*axes.get_legend_handles_labels(), loc="lower left", frameon=False)
        else:
            axes.legend(frameon=False, loc="best", handletextpad=0.2)
        for index, row in enumerate(chosen, start=1):
            mark_number(axes, points[row], index, (5.5 * x.sign, 5.5 * y.sign))
        left, size = LEFT_IN + PLOT_IN + 0.3 if wide else 0.15, 1.02
        top = base + (HEIGHT_IN if wide else 0.0) - STEP_IN + 0.03
        corners = [
            (left + (i % COLUMNS) * (size + 0.04), top - (i // COLUMNS) * STEP_IN)
            for i in range(len(chosen))
        ]
        panels = [sheet.add_box(figure, corner, (size, size)) for corner in corners]
        draw_chosen(study, front, chosen, panels)
    return figure


def _draw_candidates(axes: Axes, shown: Front) -> None:
    x, y, candidates = shown.x, shown.y, shown.candidates
    places = candidates[x.column], candidates[y.column]
    axes.scatter(*places, s=6, color="0.7", linewidths=0, label="evaluated", zorder=1)
    axes.set(xlabel=wrap(x.directed_label, LETTERS), ylabel=wrap(y.directed_label, LETTERS))
    axes.margins(0.08)


def _draw_fronts(
    axes: Axes, study: Study, fronts: Mapping[str, pd.DataFrame], x: Axis, y: Axis
) -> None:
    corner = "steps-post" if x.sign < 0 else "steps-pre"
    colours = assign_colours(study.treatments)
    if len(colours) == 1:
        colours = dict.fromkeys(colours, VERMILLION)
    markers = dict(zip(colours, cycle(MARKERS), strict=False))
    named = set[str]()
    for front in fronts.values():
        treatment = study.records[int(front.place.iloc[0])].treatment
        runs = sum(record.treatment == treatment for record in study.records)
        label = treatment if len(colours) > 1 else "front"
        label = label if runs == 1 else f"{label} ({runs} runs)"
        across, up = front[x.column].to_numpy(float), front[y.column].to_numpy(float)
        look: dict[str, Any] = {"color": colours[treatment], "lw": 0.8, "ls": "-", "ds": corner}
        look |= {"marker": markers[treatment], "ms": 3.6, "mew": 0, "zorder": 3}
        axes.plot(across, up, **look, label="_" if label in named else label)
        named.add(label)
