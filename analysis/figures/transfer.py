"""The same designs under two conditions: rank correlation and change of fitness."""

import argparse
import math
from collections.abc import Hashable, Mapping
from itertools import count
from math import factorial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from ..drawing.columns import Layout, table_height, write_table
from ..drawing.style import COLUMN_IN, assign_colours, figure_width, use_style
from ..drawing.words import cut_short
from ..product import Product
from ..statistics.small_samples import LEVEL, Interval, mean_interval, spearman
from ..tables.ladder import climb
from ..tables.paired_scores import pair_scores
from ..tables.records import FITNESS, label_fitness
from ..tables.study import Study
from .ladder import draw_ladder

HELP = "the same designs under two simulators, failures ...: ranks, changes of fitness"
NEEDS = "evaluations of the same designs under different conditions, or runs with a confirmation"
FILES = {
    "transfer.csv": "a row for each design",
    "transfer_summary.csv": "correlation and mean change of each panel and group",
}
NUMBERS = ("n", "spearman", "spearman_low", "spearman_high", "change", "change_low", "change_high")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
HEADS = {
    "group": (0.0, "left"),
    "n": (0.32, "right"),
    "rank correlation": (0.36, "left"),
    "mean change": (0.67, "left"),
}
MIN_DESIGNS = next(n for n in count(2) if 2 / factorial(n) < LEVEL)
"""Designs whose order can be significant: two of n! orders agree or disagree completely."""
NOTE = f"*too few designs for a conclusion: {MIN_DESIGNS} or more are needed"
NAME_LENGTH, RUNG_LENGTH = 16, 17
"""Maximum length of the name of a group and of a rung in the table."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the option that chooses between several parts."""
    about = (
        "the part that differs between the axes, if evaluations differ in several parts: "
        "simulator, failure ..."
    )
    parser.add_argument("--between", metavar="PART", help=about)
    about = "the evaluations are rungs, in this order, each of which is compared with the next"
    parser.add_argument("--ladder", action="store_true", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the pairs; the tables have a row for each design and for each panel and group."""
    table = climb(study) if options.ladder else pair_scores(study, options.between)
    summary = summarize(table)
    pairs = table.groupby(["x", "y"]).ngroups
    width = figure_width(options.columns, 1 if pairs == 1 or options.ladder else 2)
    messages = [_conclude(row) for row in summary.to_dict("records")]
    label = label_fitness((*study.records, *study.evaluations))
    figure = (_draw_ladder if options.ladder else draw_transfer)(table, summary, width, label)
    return Product(table, figure, messages, {"transfer_summary.csv": summary})


def _draw_ladder(table: pd.DataFrame, summary: pd.DataFrame, width: float, label: str) -> Figure:
    """Draw the designs over the rungs, with the table of the steps below."""
    rows = summary.to_dict("records")
    rungs = (cut_short(row["y"], RUNG_LENGTH) + "*" * (row["n"] < MIN_DESIGNS) for row in rows)
    cells = [(rung, *_table_row(row)[1:]) for rung, row in zip(rungs, rows, strict=True)]
    note = NOTE if bool((summary["n"] < MIN_DESIGNS).any()) else ""
    return draw_ladder(table, cells, note, width, label)


def summarize(table: pd.DataFrame) -> pd.DataFrame:
    """Summarize ``pair_scores``: a row for each pair of conditions and group, with intervals."""
    rows = []
    for (x, y, group), pairs in table.groupby(["x", "y", "group"], sort=False):
        order = spearman(pairs["x_fitness"].to_numpy(float), pairs["y_fitness"].to_numpy(float))
        change = mean_interval(pairs["change"].to_numpy(float))
        intervals = (order.value, order.low, order.high, change.value, change.low, change.high)
        rows.append((x, y, group, len(pairs), *intervals))
    return pd.DataFrame(rows, columns=["x", "y", "group", *NUMBERS])


def _conclude(row: Mapping[Hashable, Any]) -> str:
    head = f'"{row["x"]}" to "{row["y"]}"' + (f", {row['group']}" if row["group"] else "")
    if row["n"] < MIN_DESIGNS:
        return (
            f"{head}: too few designs ({row['n']}) for any conclusion: give at least {MIN_DESIGNS}"
        )
    if math.isnan(row["spearman"]):
        return f"{head}: all designs have the same fitness under one condition: they have no order"
    order, change = _format_interval(row, "spearman"), _format_change(row)
    kept = "kept in part" if row["spearman_low"] > 0 else "not shown to be kept"
    what = "fitness rises:" if row["change_low"] > 0 else "no change of fitness shown:"
    what = "fitness falls:" if row["change_high"] < 0 else what
    return f"{head}: {row['n']} designs: order {kept}, rank correlation {order}; {what} {change}"


def draw_transfer(
    table: pd.DataFrame, summary: pd.DataFrame, width: float = COLUMN_IN, label: str = FITNESS
) -> Figure:
    """Draw a panel for each pair of conditions: designs on the line are equally fit under both.

    Bars are standard errors over the trials. Tables below have bootstrap intervals; ``width`` in
    inches.
    """
    panels = list(table.groupby(["x", "y"], sort=False))
    groups = list(dict.fromkeys(summary["group"].astype(str)))
    lines = int(summary.groupby(["x", "y"]).size().max())
    few = bool((summary["n"] < MIN_DESIGNS).any())
    layout = Layout(len(panels), width, 0.9 * COLUMN_IN, table_height(lines, few))
    with use_style():
        figure, parts = layout.make_figure()
        for (top, bottom), ((x, y), pairs) in zip(parts, panels, strict=True):
            _draw_panel(top.subplots(), pairs, groups, label)
            if any(groups):
                _add_legend(top)
            rows = summary[(summary["x"] == x) & (summary["y"] == y)]
            cells = list(map(_table_row, rows.to_dict("records")))
            write_table(bottom, HEADS, cells, layout.table_size, NOTE if few else "")
    return figure


def _format_interval(row: Mapping[Hashable, Any], name: str, form: str = ".2f") -> str:
    return Interval(row[name], row[f"{name}_low"], row[f"{name}_high"]).write(form)


def _format_change(row: Mapping[Hashable, Any]) -> str:
    """Format the mean change of fitness from the first condition to the second, with its sign."""
    return _format_interval(row, "change", "+.2f").replace("-", "\N{MINUS SIGN}")


def _table_row(row: Mapping[Hashable, Any]) -> tuple[str, ...]:
    short = cut_short(str(row["group"]) or "all", NAME_LENGTH)
    mark = "*" if row["n"] < MIN_DESIGNS else ""
    return f"{short}{mark}", str(row["n"]), _format_interval(row, "spearman"), _format_change(row)


def _draw_panel(axes: Axes, pairs: pd.DataFrame, groups: list[str], label: str) -> None:
    colours = assign_colours(groups)
    errors = {side: pairs[f"{side}_sd"] / np.sqrt(pairs[f"{side}_trials"]) for side in "xy"}
    for index, group in enumerate(groups):
        rows = pairs["group"].astype(str) == group
        if rows.any():
            x, y = pairs["x_fitness"][rows], pairs["y_fitness"][rows]
            bars = {f"{side}err": errors[side][rows].fillna(0.0) for side in "xy"}
            axes.errorbar(x, y, **bars, fmt="none", ecolor="0.6", elinewidth=0.6, zorder=1)
            marker = MARKERS[index % len(MARKERS)]
            axes.scatter(x, y, s=11, c=colours[group], marker=marker, lw=0, label=group, zorder=3)
    low, high = _limits(pairs, errors)
    axes.plot([low, high], [low, high], color="0.3", lw=0.8, ls=(0, (4, 2)), zorder=2)
    axes.set(xlim=(low, high), ylim=(low, high), aspect="equal")
    part = pairs["between"].iloc[0]
    axes.set(xlabel=f"{label}, {part}: {pairs['x'].iloc[0]}")
    axes.set(ylabel=f"{label}, {part}: {pairs['y'].iloc[0]}")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))


def _add_legend(figure: SubFigure) -> None:
    """Add a legend above the panel, with as many names in a line as fit."""
    (axes,) = figure.axes
    names = [str(label) for label in axes.get_legend_handles_labels()[1]]
    columns = max(1, min(len(names), int(50 / (max(map(len, names)) + 5))))
    style: dict[str, Any] = {"handletextpad": 0.1, "columnspacing": 1.0, "borderpad": 0.1}
    figure.legend(loc="outside upper center", ncols=columns, frameon=False, **style)


def _limits(pairs: pd.DataFrame, errors: Mapping[str, "pd.Series[float]"]) -> tuple[float, float]:
    """Return common limits of both axes, with a margin."""
    bounds = [
        pairs[f"{side}_fitness"] + sign * errors[side].fillna(0.0)
        for side in "xy"
        for sign in (-1, 1)
    ]
    low, high = min(map(min, bounds)), max(map(max, bounds))
    margin = 0.04 * (high - low) or 1.0
    return low - margin, high + margin
