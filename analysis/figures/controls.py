"""Champions and their controls: no sensors, random search, hand-made designs."""

import argparse
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evoros.base.arrays import Array

from ..drawing.style import BLUE, VERMILLION, cut_short, figure_width, use_style
from ..statistics.controls import (
    FITNESS,
    SHARES,
    TITLES,
    compare_controls,
    describe_controls,
    summarize_controls,
)
from ..subcommands import Product
from ..tables.records import label_fitness
from ..tables.study import Study

HELP = "each champion against no sensors, random search and hand-made designs"
NEEDS = "runs with controls"
FILES = {
    "controls.csv": "a row for each run and control",
    "controls_summary.csv": "means over the runs, a row for each treatment and control",
}
LOOKS = {"control": (VERMILLION, 7.0, "white"), "champion": (BLUE, 4.0, BLUE)}
"""Edge colour, size and face colour of each side's marker."""
INTERVAL = "95 % interval of the difference"
ROW_IN, HEAD_IN = 0.24, 0.85
NAME_LENGTH = 28


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the means of champions and controls; small dots are single runs."""
    table = compare_controls(study)
    summary = summarize_controls(table)
    label = label_fitness(study.records)
    figure = draw_controls(table, summary, figure_width(options.columns, 2), label)
    messages = describe_controls(summary, label)
    return Product(table, figure, messages, {"controls_summary.csv": summary})


def draw_controls(
    table: pd.DataFrame, summary: pd.DataFrame, width: float, label: str = "fitness"
) -> Figure:
    """Draw one row per treatment and control, by completion rate and by fitness."""
    several = summary["treatment"].nunique() > 1
    keys = list(zip(summary["treatment"], summary["control"], strict=True))
    names = [
        cut_short((f"{treatment}: " if several else "") + TITLES.get(name, name), NAME_LENGTH)
        for treatment, name in keys
    ]
    with use_style():
        size = (width, HEAD_IN + ROW_IN * len(keys))
        figure = Figure(figsize=size, layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True)
        for axes, columns, scale in ((left, SHARES, 100.0), (right, FITNESS, 1.0)):
            for height, key in enumerate(keys):
                runs = table[(table["treatment"] == key[0]) & (table["control"] == key[1])]
                _draw_row(axes, scale * runs[list(columns)].to_numpy(float), height)
        ends = (summary["champion_completed"] - summary[name] for name in ("high", "low"))
        bars = {"color": VERMILLION, "lw": 1.0, "capsize": 2.5, "zorder": 2}
        spans = np.clip([100 * end.to_numpy(float) for end in ends], 0.0, 100.0)
        left.errorbar(
            spans.mean(axis=0),
            range(len(keys)),
            xerr=np.ptp(spans, axis=0) / 2,
            fmt="none",
            label=INTERVAL,
            **bars,
        )
        left.set(xlabel="completed missions [%]", xlim=(-4, 104), yticks=range(len(keys)))
        left.set_yticklabels(names)
        left.set_ylim(len(keys) - 0.5, -0.5)
        right.set(xlabel=label)
        handles, titles = left.get_legend_handles_labels()
        figure.legend(handles, titles, loc="outside upper center", ncols=3, frameon=False)
    return figure


def _draw_row(axes: Axes, values: Array, y: int) -> None:
    """Draw the runs' values (n, 2), control first, and connect their means."""
    means = values.mean(axis=0)
    axes.plot(means, [y, y], color="0.7", lw=1.5, zorder=1)
    for side, (name, (edge, size, face)) in enumerate(LOOKS.items()):
        if len(values) > 1:
            heights = y + 0.25 * np.linspace(-1, 1, len(values))
            axes.scatter(values[:, side], heights, s=3, color=edge, alpha=0.5, lw=0, zorder=2)
        known = axes.get_legend_handles_labels()[1]
        look: dict[str, Any] = {"marker": "o", "ms": size, "mec": edge, "mfc": face, "lw": 0}
        axes.plot(means[side], y, **look, zorder=3, label=None if name in known else name)
