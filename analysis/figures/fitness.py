"""Fitness by generation or cost: all individuals of one run (Fig. 9), or several runs."""

import argparse
import math
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..drawing.style import (
    COLUMN_IN,
    VERMILLION,
    assign_dashes,
    figure_width,
    is_wide,
    use_style,
    wrap,
)
from ..statistics.small_samples import Interval
from ..subcommands import Product
from ..tables.costs import AXES, GENERATION, add_axis, add_costs, compute_quartiles, trace_costs
from ..tables.designs import list_individuals
from ..tables.records import FITNESS, label_fitness
from ..tables.study import Study

HELP = "fitness over generations or cost: all individuals of a run, or quartiles of several"
NEEDS = "runs with at least one generation"
FILES = ("fitness.csv",)
add_arguments = add_axis
LABELS = {"recorded": "best, recorded", "validated": "best, validated", "mean": "mean of pool"}
ONE = "dots: designs in the generation's pool"
SEVERAL = "lines: medians over the runs; bands: quartiles"
STYLES = {  # colours and dash patterns, distinct in greyscale too
    "recorded": ("black", "-"),
    "validated": (VERMILLION, (0, (4, 1))),
    "mean": ("0.45", (0, (1, 1.2))),
}
_LETTERS_PER_IN, _LEGEND_PER_IN = 13, 16  # characters per inch of titles, and of the legend


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the individuals of one run, or quartiles of several runs."""
    generations, axis = add_costs(study, options.axis), options.axis
    several = generations["run"].nunique() > 1
    treatments = generations["treatment"].nunique() if several else 1
    width = figure_width(options.columns, min(2, treatments))
    table = compute_quartiles(generations, axis) if several else list_individuals(generations, axis)
    interval = None if several else _read_interval(study)
    label = label_fitness(study.records)
    return Product(table, draw_fitness(generations, width, interval, label, axis))


def _read_interval(study: Study) -> Interval | None:
    status = study.records[0].run.status
    ends = [status.get(name) for name in ("best_validated_fitness", "fitness_low", "fitness_high")]
    value, low, high = (math.nan if end is None else float(end) for end in ends)
    return None if math.isnan(low) else Interval(value, low, high)


def draw_fitness(
    generations: pd.DataFrame,
    width: float = COLUMN_IN,
    champion: Interval | None = None,
    label: str = FITNESS,
    axis: str = GENERATION,
) -> Figure:
    """Draw the individuals of one run, or quartiles of several runs by treatment."""
    with use_style():
        if "run" not in generations or generations["run"].nunique() == 1:
            return _draw_one(generations, width, champion, label, axis)
        return _draw_several(compute_quartiles(generations, axis), width, label, axis)


def _draw_one(
    generations: pd.DataFrame, width: float, champion: Interval | None, label: str, axis: str
) -> Figure:
    figure = Figure(figsize=(width, min(0.72 * width, 3.2)), layout="constrained")
    axes, traced, x = figure.subplots(), trace_costs(generations, axis), generations[axis]
    axes.scatter(x, generations["fitness"], s=5, c=x, cmap="viridis", alpha=0.6, linewidths=0)
    for name, meaning in LABELS.items():
        if traced[name].notna().any():
            colour, dashes = STYLES[name]
            axes.plot(traced[name], color=colour, lw=1.2, ls=dashes, label=meaning)
    if champion is not None:
        last = float(x.max())
        beside = last + 0.02 * (max(25.0, last) if axis == GENERATION else last)
        axes.vlines(beside, champion.low, champion.high, color=VERMILLION, lw=1.6)
        axes.plot(beside, champion.value, "o", c=VERMILLION, ms=3.5, label="champion, interval")
    _finish(figure, [axes], ONE, label, axis)
    return figure


def _draw_several(table: pd.DataFrame, width: float, label: str, axis: str) -> Figure:
    """Draw all lines of a single treatment in one panel, or all treatments in a panel per line."""
    counts = table.groupby("treatment", sort=False)["replicates"].max()
    names = {str(name): f"{name} (n = {count})" for name, count in counts.items()}
    (first, *others), looks = names.values(), assign_dashes(list(names))
    panels = {first: [(table, name, STYLES[name], LABELS[name]) for name in LABELS]}
    if others:
        known = [
            name for name in ("recorded", "validated") if table[f"{name}_median"].notna().any()
        ]
        by = [
            (table[table["treatment"] == name], look, names[name]) for name, look in looks.items()
        ]
        panels = {LABELS[line]: [(r, line, look, name) for r, look, name in by] for line in known}
    across = len(panels) if is_wide(width) else 1
    below = len(panels) // across
    height = below * min(0.72 * width / across, 2.4) + 0.14 * (2 + len(others))
    figure = Figure(figsize=(width, height), layout="constrained")
    grid = figure.subplots(below, across, squeeze=False, sharex=True, sharey=True)
    for axes, (title, curves) in zip(grid.flat, panels.items(), strict=True):
        axes.set_title(wrap(title, _LETTERS_PER_IN * width / across))
        axes.tick_params(labelbottom=True)
        for curve in curves:
            _draw_quartiles(axes, *curve, axis)
    _finish(figure, list(grid.flat), SEVERAL, label, axis)
    return figure


def _draw_quartiles(
    axes: Axes, table: pd.DataFrame, name: str, look: tuple[str, Any], meaning: str, axis: str
) -> None:
    """Draw a median and quartiles, up to the cost that all runs have reached."""
    by_cost = axis != GENERATION
    everyone = table["replicates"] == table["replicates"].max()
    known = table[table[f"{name}_median"].notna() & (everyone | (not by_cost))]
    if known.empty:
        return
    colour, dashes = look
    median, low, high = (known[f"{name}_{end}"] for end in ("median", "q1", "q3"))
    steps: dict[str, Any] = {"ds": "steps-post"} if by_cost else {}
    axes.plot(known[axis], median, color=colour, lw=1.2, ls=dashes, label=meaning, **steps)
    if name != "mean":
        step: Any = "post" if by_cost else None
        axes.fill_between(known[axis], low, high, color=colour, alpha=0.15, lw=0, step=step)


def _finish(figure: Figure, panels: list[Axes], meaning: str, label: str, axis: str) -> None:
    for axes in panels:
        axes.set_xlabel(AXES[axis])
        axes.xaxis.set_major_locator(MaxNLocator("auto", integer=True, steps=[1, 2, 5, 10]))
        if len({other.get_position().y0 for other in panels}) == len(panels) or axes is panels[0]:
            axes.set_ylabel(wrap(label, _LETTERS_PER_IN * figure.get_figheight() / 2))
    handles, labels = panels[0].get_legend_handles_labels()
    fit = int(_LEGEND_PER_IN * figure.get_figwidth() / (max(map(len, labels)) + 4))
    style = {"ncols": max(1, min(3, len(labels) // 2 + 1, fit)), "frameon": False}
    figure.legend(handles, labels, title=meaning, loc="outside lower center", **style)
