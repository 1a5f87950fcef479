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

from evoros.base.arrays import Array
from evoros.fitness.naming import UNBOUNDED

from ..drawing.sheet import Layout, table_height, write_table
from ..drawing.style import (
    CATEGORIES,
    COLUMN_IN,
    assign_colours,
    cut_short,
    figure_width,
    use_style,
)
from ..statistics.small_samples import (
    LEVEL,
    MIN_PAIRS,
    Interval,
    describe_shortfalls,
    mean_interval,
    spearman,
)
from ..subcommands import Product
from ..tables.pairs import climb, pair_scores
from ..tables.records import FITNESS, bound_scores, label_fitness
from ..tables.study import Study

HELP = "designs in two simulators or under two failure models: changes in rank and fitness"
NEEDS = "evaluations of the same designs under different conditions, or runs with a confirmation"
FILES = ("transfer.csv", "transfer_summary.csv")
NUMBERS = ("n", "spearman", "spearman_low", "spearman_high", "change", "change_low", "change_high")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
_NUMBER_HEADS = {
    "n": (0.33, "right"),
    "rank correlation": (0.36, "left"),
    "mean change": (0.67, "left"),
}
HEADS = {"group": (0.0, "left"), **_NUMBER_HEADS}
RUNG_HEADS = {"to the rung": (0.0, "left"), **_NUMBER_HEADS}
MIN_DESIGNS = next(n for n in count(2) if 2 / factorial(n) < LEVEL)  # two of n! orders are extreme
BARS = "bars: standard errors over the trials"
NOTE = f"{BARS}\n*too few designs for a conclusion: {MIN_DESIGNS} or more are needed"
NAME_LENGTH, RUNG_LENGTH = 16, 17  # maximum lengths of a group name and of a rung name in the table
NAMED = 8  # maximum number of designs with names and colours; more are drawn in grey
_APART = 0.03  # distance between the dots of two designs, in rungs


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--between`` and ``--ladder``."""
    about = "the part to compare, such as simulator, if evaluations differ in several parts"
    parser.add_argument("--between", metavar="PART", help=about)
    about = "compare each evaluation with the next one, as rungs of a ladder in the given order"
    parser.add_argument("--ladder", action="store_true", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the pairs; tables have one row per design, and one row per panel and group."""
    table = climb(study) if options.ladder else pair_scores(study, options.between)
    summary = summarize(table)
    pairs = table.groupby(["x", "y"]).ngroups
    width = figure_width(options.columns, 1 if pairs == 1 or options.ladder else 2)
    messages = [*map(_conclude, summary.to_dict("records"))]
    messages += describe_shortfalls("mean, bootstrap")
    records = (*study.records, *study.evaluations)
    draw = draw_ladder if options.ladder else draw_transfer
    figure = draw(table, summary, width, label_fitness(records), bound_scores(records))
    return Product(table, figure, messages, {"transfer_summary.csv": summary})


def summarize(table: pd.DataFrame) -> pd.DataFrame:
    """Summarize ``pair_scores`` with intervals: a row per pair of conditions and group."""
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
            f"{head}: too few designs ({row['n']}) for any conclusion; "
            f"evaluate at least {MIN_DESIGNS}"
        )
    if math.isnan(row["spearman"]):
        return (
            f"{head}: all designs have the same fitness under one condition, so there is no ranking"
        )
    order, change = _format_interval(row, "spearman"), _format_change(row)
    kept = "partly preserved" if row["spearman_low"] > 0 else "not shown to be preserved"
    kept = kept if row["n"] >= MIN_PAIRS else f"not assessed with fewer than {MIN_PAIRS} designs"
    what = "fitness rises:" if row["change_low"] > 0 else "no significant change in fitness:"
    what = "fitness falls:" if row["change_high"] < 0 else what
    return f"{head}: {row['n']} designs: ranking {kept}, rank correlation {order}; {what} {change}"


def draw_transfer(
    table: pd.DataFrame,
    summary: pd.DataFrame,
    width: float = COLUMN_IN,
    label: str = FITNESS,
    bounds: tuple[float, float] = UNBOUNDED,
) -> Figure:
    """Draw a panel per pair of conditions; designs on the diagonal have equal scores."""
    panels = list(table.groupby(["x", "y"], sort=False))
    groups = list(dict.fromkeys(summary["group"].astype(str)))
    lines = int(summary.groupby(["x", "y"]).size().max())
    few = bool((summary["n"] < MIN_DESIGNS).any())
    layout = Layout(len(panels), width, 0.9 * COLUMN_IN, table_height(lines, 1 + few))
    with use_style():
        figure, parts = layout.make_figure()
        for (top, bottom), ((x, y), pairs) in zip(parts, panels, strict=True):
            _draw_panel(top.subplots(), pairs, groups, label, bounds)
            if any(groups):
                _add_legend(top)
            rows = summary[(summary["x"] == x) & (summary["y"] == y)]
            cells = list(map(_table_row, rows.to_dict("records")))
            write_table(bottom, HEADS, cells, layout.table_size, NOTE if few else BARS)
    return figure


def _format_interval(row: Mapping[Hashable, Any], name: str, form: str = ".2f") -> str:
    return Interval(row[name], row[f"{name}_low"], row[f"{name}_high"]).write(form)


def _format_change(row: Mapping[Hashable, Any]) -> str:
    return _format_interval(row, "change", "+.2f").replace("-", "\N{MINUS SIGN}")


def _table_row(row: Mapping[Hashable, Any]) -> tuple[str, ...]:
    short = cut_short(str(row["group"]) or "all", NAME_LENGTH)
    mark = "*" if row["n"] < MIN_DESIGNS else ""
    return f"{short}{mark}", str(row["n"]), _format_interval(row, "spearman"), _format_change(row)


def _draw_panel(
    axes: Axes, pairs: pd.DataFrame, groups: list[str], label: str, bounds: tuple[float, float]
) -> None:
    colours = assign_colours(groups)
    errors = {
        side: measure_bars(
            pairs[[f"{side}_{name}" for name in ("fitness", "sd", "trials")]].to_numpy(float),
            bounds,
        )
        for side in "xy"
    }
    for index, group in enumerate(groups):
        rows = pairs["group"].astype(str) == group
        if rows.any():
            x, y = pairs["x_fitness"][rows], pairs["y_fitness"][rows]
            bars: dict[str, Any] = {f"{side}err": errors[side][:, rows] for side in "xy"}
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
    (axes,) = figure.axes
    names = [str(label) for label in axes.get_legend_handles_labels()[1]]
    columns = max(1, min(len(names), int(50 / (max(map(len, names)) + 5))))
    style: dict[str, Any] = {"handletextpad": 0.1, "columnspacing": 1.0, "borderpad": 0.1}
    figure.legend(loc="outside upper center", ncols=columns, frameon=False, **style)


def _limits(pairs: pd.DataFrame, errors: Mapping[str, Array]) -> tuple[float, float]:
    low = min((pairs[f"{side}_fitness"] - errors[side][0]).min() for side in "xy")
    high = max((pairs[f"{side}_fitness"] + errors[side][1]).max() for side in "xy")
    margin = 0.04 * (high - low) or 1.0
    return low - margin, high + margin


def draw_ladder(
    table: pd.DataFrame,
    summary: pd.DataFrame,
    width: float = COLUMN_IN,
    label: str = FITNESS,
    bounds: tuple[float, float] = UNBOUNDED,
) -> Figure:
    """Draw a line per design over the rungs, and their mean in black."""
    rows = summary.to_dict("records")
    names = (cut_short(row["y"], RUNG_LENGTH) + "*" * (row["n"] < MIN_DESIGNS) for row in rows)
    cells = [(name, *_table_row(row)[1:]) for name, row in zip(names, rows, strict=True)]
    note = NOTE if bool((summary["n"] < MIN_DESIGNS).any()) else BARS
    layout = Layout(1, width, 0.85 * COLUMN_IN, table_height(len(cells), 1 + note.count("\n")))
    rungs = list(dict.fromkeys([str(table["x"].iloc[0]), *table["y"].astype(str)]))
    with use_style():
        figure, ((top, bottom),) = layout.make_figure()
        axes = top.subplots()
        _draw_lines(axes, table, bounds)
        axes.set(xticks=range(len(rungs)), xlim=(-0.35, len(rungs) - 0.65), ylabel=label)
        axes.set_xticklabels([rung.replace(", ", "\n") for rung in rungs])
        if table.groupby(["source", "design"]).ngroups <= NAMED:
            columns = {"ncols": int(width), "columnspacing": 1.0}
            top.legend(loc="outside upper center", frameon=False, **columns)
        write_table(bottom, RUNG_HEADS, cells, layout.table_size, note)
    return figure


def measure_bars(scores: Array, bounds: tuple[float, float]) -> Array:
    """Return the error bars (2, n), within bounds, of scores (n, 3): mean, deviation, trials."""
    fitness, sd, trials = scores.T
    errors = np.nan_to_num(sd / np.sqrt(trials))
    room = np.maximum([fitness - bounds[0], bounds[1] - fitness], 0.0)
    return np.asarray(np.minimum(errors, room))


def _draw_lines(axes: Axes, table: pd.DataFrame, bounds: tuple[float, float]) -> None:
    designs = list(table.groupby(["source", "design"], sort=False))
    heights = []
    for index, ((source, design), steps) in enumerate(designs):
        along = steps[["y_fitness", "y_sd", "y_trials"]].to_numpy(float)
        first = steps[["x_fitness", "x_sd", "x_trials"]].to_numpy(float)[:1]
        scores = np.vstack([first, along])
        fitness, errors = scores[:, 0], measure_bars(scores, bounds)
        heights.append(fitness)
        shift = (index - (len(designs) - 1) / 2) * min(_APART, 0.4 / len(designs))
        named = len(designs) <= NAMED
        colour = CATEGORIES[index % len(CATEGORIES)] if named else "0.6"
        label = f"{str(source).rstrip('/').rpartition('/')[2]}: {design}" if named else None
        look: dict[str, Any] = {"lw": 0.8, "marker": "o", "ms": 3.0, "elinewidth": 0.6}
        places = np.arange(len(fitness)) + shift
        axes.errorbar(places, fitness, errors, color=colour, label=label, **look)
    if len(designs) > 1:
        mean = np.mean(heights, axis=0)
        axes.plot(range(len(mean)), mean, color="black", lw=1.8, zorder=4, label="mean")
