"""Fitness over generations: every individual of one run (Fig. 9), or quartiles of several runs."""

import argparse
import math
from collections.abc import Mapping

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..drawing.style import COLUMN_IN, VERMILLION, figure_width, use_style, wrap
from ..statistics.small_samples import Interval
from ..subcommands import Product
from ..tables.designs import compute_quartiles, list_individuals, trace_fitness
from ..tables.records import FITNESS, label_by_treatment
from ..tables.study import Study

HELP = "fitness over generations: every individual of one run, or quartiles of several"
NEEDS = "runs with at least one generation"
FILES = ("fitness.csv",)
LABELS = {"recorded": "best, recorded", "validated": "best, validated", "mean": "mean of pool"}
ONE = "dots: designs in the generation's pool"
SEVERAL = "lines: medians over the runs; bands: quartiles"
STYLES = {  # colours and dash patterns, both distinct in greyscale print
    "recorded": ("black", "-"),
    "validated": (VERMILLION, (0, (4, 1))),
    "mean": ("0.45", (0, (1, 1.2))),
}
_PANEL_IN = 2.2  # minimum width of a panel
_LETTERS_PER_IN = 13  # title characters per inch


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the individuals of one run, or the quartiles of several."""
    generations = study.generations
    several = generations["run"].nunique() > 1
    panels = generations["treatment"].nunique() if several else 1
    width = figure_width(options.columns, 1 if panels == 1 else 2)
    table = compute_quartiles(generations) if several else list_individuals(generations)
    interval = None if several else _read_interval(study)
    labels = label_by_treatment(study.records)
    return Product(table, draw_fitness(generations, width, interval, labels))


def _read_interval(study: Study) -> Interval | None:
    status = study.records[0].run.status
    ends = [status.get(name) for name in ("best_validated_fitness", "fitness_low", "fitness_high")]
    value, low, high = (math.nan if end is None else float(end) for end in ends)
    return None if math.isnan(low) else Interval(value, low, high)


def draw_fitness(
    generations: pd.DataFrame,
    width: float = COLUMN_IN,
    champion: Interval | None = None,
    labels: Mapping[str, str] | None = None,
) -> Figure:
    """Draw one run's individuals, or the quartiles of several runs in a panel per treatment."""
    names = labels or {}
    several = "run" in generations and generations["run"].nunique() > 1
    with use_style():
        if several:
            return _draw_several(compute_quartiles(generations), width, names)
        return _draw_one(generations, width, champion, next(iter(names.values()), FITNESS))


def _draw_one(
    generations: pd.DataFrame, width: float, champion: Interval | None, label: str
) -> Figure:
    figure = Figure(figsize=(width, min(0.72 * width, 3.2)), layout="constrained")
    axes, traced = figure.subplots(), trace_fitness(generations)
    x, y = generations["generation"], generations["fitness"]
    axes.scatter(x, y, s=5, c=x, cmap="viridis", alpha=0.6, linewidths=0)
    for name, meaning in LABELS.items():
        if traced[name].notna().any():
            colour, dashes = STYLES[name]
            axes.plot(traced[name], color=colour, lw=1.2, ls=dashes, label=meaning)
    if champion is not None:
        beside = x.max() + 0.02 * max(25, x.max())
        axes.vlines(beside, champion.low, champion.high, color=VERMILLION, lw=1.6)
        axes.plot(beside, champion.value, "o", c=VERMILLION, ms=3.5, label="champion, interval")
    axes.set(xlabel="generation", ylabel=wrap(label, _LETTERS_PER_IN * figure.get_figheight()))
    _finish(figure, [axes], ONE)
    return figure


def _draw_several(table: pd.DataFrame, width: float, labels: Mapping[str, str]) -> Figure:
    treatments = list(dict.fromkeys(table["treatment"]))
    rows = math.ceil(len(treatments) / max(1, int(width / _PANEL_IN)))
    columns = math.ceil(len(treatments) / rows)
    height = min(0.72 * width / columns, 1.7) * rows + 0.4
    figure = Figure(figsize=(width, height), layout="constrained")
    common = len(set(labels.values())) <= 1
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=common)
    panels = list(grid.flat)
    for axes, treatment in zip(panels, treatments, strict=False):
        quartiles = table[table["treatment"] == treatment]
        _draw_quartiles(axes, quartiles)
        title = f"{treatment} (n = {quartiles['replicates'].max()})"
        axes.set_title(wrap(title, _LETTERS_PER_IN * width / columns))
        axes.tick_params(labelbottom=True)
        if axes in grid[:, 0] or not common:
            label = labels.get(str(treatment), FITNESS)
            axes.set_ylabel(wrap(label, _LETTERS_PER_IN * height / rows))
    for axes in panels[len(treatments) :]:
        axes.remove()
    for axes in panels[max(0, len(treatments) - columns) : len(treatments)]:
        axes.set_xlabel("generation")
    _finish(figure, panels[: len(treatments)], SEVERAL)
    return figure


def _draw_quartiles(axes: Axes, table: pd.DataFrame) -> None:
    for name, label in LABELS.items():
        known = table[table[f"{name}_median"].notna()]
        if known.empty:
            continue
        colour, dashes = STYLES[name]
        generation = known["generation"]
        median, low, high = (known[f"{name}_{end}"] for end in ("median", "q1", "q3"))
        axes.plot(generation, median, color=colour, lw=1.2, ls=dashes, label=label)
        if name != "mean":
            axes.fill_between(generation, low, high, color=colour, alpha=0.2, lw=0)


def _finish(figure: Figure, panels: list[Axes], meaning: str) -> None:
    for axes in panels:
        axes.xaxis.set_major_locator(MaxNLocator("auto", integer=True, steps=[1, 2, 5, 10]))
    handles, labels = panels[0].get_legend_handles_labels()
    style = {"ncols": 2 if len(handles) == 4 else 3, "frameon": False, "handlelength": 2.0}
    figure.legend(handles, labels, title=meaning, loc="outside lower center", **style)
