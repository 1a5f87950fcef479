"""Fitness over the generations: the paper's Fig. 9 of one run, quartiles of several."""

import argparse
import math
from textwrap import fill

import matplotlib as mpl
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..drawing.style import COLUMN_IN, STYLE, VERMILLION
from ..drawing.style import width as width_of
from ..product import Product
from ..tables.study import Study

HELP = "fitness over the generations: every individual of one run, quartiles of several"
LINES = {"recorded": "best, recorded", "validated": "best, validated", "mean": "mean of pool"}
DRAWN = {  # colour and dashes; recorded and validated differ in both, for print without colour
    "recorded": ("black", "-"),
    "validated": (VERMILLION, (0, (4, 1))),
    "mean": ("0.45", (0, (1, 1.2))),
}
_PANEL_IN = 2.2  # the least width of a panel
_LETTERS_PER_IN = 13  # of a title


def product(study: Study, options: argparse.Namespace) -> Product:
    """The command's: points and lines of one run, or the quartiles of several."""
    generations = study.generations
    several = generations["run"].nunique() > 1
    panels = generations["treatment"].nunique() if several else 1
    wide = width_of(options.columns, 1 if panels == 1 else 2)
    table = quartiles(generations) if several else points(generations)
    return Product(table, fitness(generations, wide))


def fitness(generations: pd.DataFrame, width: float = COLUMN_IN) -> Figure:
    """Of one run a point an individual, the best and the mean; of several the quartiles.

    ``generations`` has the columns of a run's generation tables and, where it is of several runs,
    ``run`` and ``treatment``, which gets a panel; ``width`` is in inches. Individuals that a
    generation only kept are drawn in each generation in which they stand.
    """
    several = "run" in generations and generations["run"].nunique() > 1
    with mpl.rc_context(STYLE):
        return _several(quartiles(generations), width) if several else _one(generations, width)


def lines(generations: pd.DataFrame) -> pd.DataFrame:
    """What a line of one run has at each generation, its index.

    Columns ``recorded`` and ``validated``, fitness of the generation's best, and ``mean`` of its
    pool.
    """
    best = bests(generations)
    return pd.DataFrame(
        {
            "recorded": best["fitness"],
            "validated": best["validated_fitness"],
            "mean": generations.groupby("generation")["fitness"].mean(),
        }
    )


def bests(generations: pd.DataFrame) -> pd.DataFrame:
    """The row of the best candidate of each generation of one run, by generation.

    As in the run: with a confirmation it is the fittest of those that were confirmed.
    """
    confirmed = generations["loss"].notna() if "loss" in generations else True
    ranked = generations.assign(confirmed=confirmed).sort_values(
        ["confirmed", "fitness"], ascending=False, kind="stable"
    )
    first = ranked.drop_duplicates("generation").drop(columns="confirmed")
    return first.set_index("generation").sort_index()


def points(generations: pd.DataFrame) -> pd.DataFrame:
    """The numbers drawn of one run: a row a point, with the lines of its generation."""
    names = {"recorded": "best_recorded", "validated": "best_validated"}
    table = generations[["generation", "id", "operator", "fitness", "validated_fitness"]]
    return table.join(lines(generations).rename(columns=names), on="generation")


def quartiles(generations: pd.DataFrame) -> pd.DataFrame:
    """The numbers drawn of several runs: a row for each treatment and generation.

    ``replicates`` (``validated_replicates``) are the runs that have the generation (and validated
    its best); then the quartiles over them, interpolated linearly, of the fitness of the best,
    recorded and validated, and of the mean of the pool.
    """
    runs = generations.groupby(["treatment", "run"])[list(generations.columns)]
    each = runs.apply(lines).groupby(["treatment", "generation"])
    table = each["recorded"].count().to_frame("replicates")
    table["validated_replicates"] = each["validated"].count()
    for line in LINES:
        for name, share in (("q1", 0.25), ("median", 0.5), ("q3", 0.75)):
            table[f"{line}_{name}"] = each[line].quantile(share)
    return table.loc[list(dict.fromkeys(generations["treatment"]))].reset_index()


def _one(generations: pd.DataFrame, width: float) -> Figure:
    figure = Figure(figsize=(width, min(0.72 * width, 3.2)), layout="constrained")
    axes, drawn = figure.subplots(), lines(generations)
    axes.scatter(
        generations["generation"],
        generations["fitness"],
        s=5,
        c=generations["generation"],
        cmap="viridis",
        alpha=0.6,
        linewidths=0,
    )
    for name, label in LINES.items():
        if drawn[name].notna().any():
            color, dashes = DRAWN[name]
            axes.plot(drawn[name], color=color, lw=1.2, ls=dashes, label=label)
    axes.set(xlabel="generation", ylabel="fitness (Eq. 1)")
    _dress(figure, [axes])
    return figure


def _several(table: pd.DataFrame, width: float) -> Figure:
    """A panel a treatment, on common axes."""
    treatments = list(dict.fromkeys(table["treatment"]))
    rows = math.ceil(len(treatments) / max(1, int(width / _PANEL_IN)))
    columns = math.ceil(len(treatments) / rows)
    height = min(0.72 * width / columns, 1.7) * rows + 0.4
    figure = Figure(figsize=(width, height), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    panels = list(grid.flat)
    for axes, treatment in zip(panels, treatments, strict=False):
        _panel(axes, table[table["treatment"] == treatment])
        runs = table["replicates"][table["treatment"] == treatment].max()
        title = f"{treatment} (n = {runs})"
        axes.set_title(fill(title, int(_LETTERS_PER_IN * width / columns)))
        axes.tick_params(labelbottom=True)
    for axes in panels[len(treatments) :]:
        axes.remove()
    for row in grid:
        row[0].set_ylabel("fitness (Eq. 1)")
    for axes in panels[max(0, len(treatments) - columns) : len(treatments)]:
        axes.set_xlabel("generation")
    _dress(figure, panels[: len(treatments)])
    return figure


def _panel(axes: Axes, table: pd.DataFrame) -> None:
    """The quartiles of one treatment."""
    for name, label in LINES.items():
        drawn = table[table[f"{name}_median"].notna()]
        if drawn.empty:
            continue
        color, dashes = DRAWN[name]
        at = drawn["generation"]
        axes.plot(at, drawn[f"{name}_median"], color=color, lw=1.2, ls=dashes, label=label)
        if name != "mean":
            low, high = drawn[f"{name}_q1"], drawn[f"{name}_q3"]
            axes.fill_between(at, low, high, color=color, alpha=0.2, lw=0)


def _dress(figure: Figure, panels: list[Axes]) -> None:
    for axes in panels:
        axes.xaxis.set_major_locator(MaxNLocator("auto", integer=True, steps=[1, 2, 5, 10]))
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=3, frameon=False, handlelength=2.0
    )
