"""The same designs on the rungs of a ladder, as lines from rung to rung."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..drawing.columns import Layout, table_height, write_table
from ..drawing.style import CATEGORIES, COLUMN_IN, use_style

HEADS = {
    "to the rung": (0.0, "left"),
    "n": (0.33, "right"),
    "rank correlation": (0.36, "left"),
    "mean change": (0.67, "left"),
}
NAMED = 8
"""Designs that have colours and names; of more, all are grey."""
_APART = 0.03  # between the dots of two designs, in rungs


def draw_ladder(
    table: pd.DataFrame,
    cells: Sequence[tuple[str, ...]],
    note: str,
    width: float = COLUMN_IN,
    label: str = "fitness",
) -> Figure:
    """Draw a line for each design over the rungs, and the mean of all in black.

    ``table`` is from ``climb``. ``cells`` are rows of the table below and ``note`` its last
    line. Bars are standard errors over the trials.
    """
    layout = Layout(1, width, 0.85 * COLUMN_IN, table_height(len(cells), bool(note)))
    rungs = list(dict.fromkeys([str(table["x"].iloc[0]), *table["y"].astype(str)]))
    with use_style():
        figure, ((top, bottom),) = layout.make_figure()
        axes = top.subplots()
        _draw_lines(axes, table)
        axes.set(xticks=range(len(rungs)), xlim=(-0.35, len(rungs) - 0.65), ylabel=label)
        axes.set_xticklabels([rung.replace(", ", "\n") for rung in rungs])
        if table.groupby(["source", "design"]).ngroups <= NAMED:
            columns = {"ncols": int(width), "columnspacing": 1.0}
            top.legend(loc="outside upper center", frameon=False, **columns)
        write_table(bottom, HEADS, cells, layout.table_size, note)
    return figure


def _draw_lines(axes: Axes, table: pd.DataFrame) -> None:
    designs = list(table.groupby(["source", "design"], sort=False))
    heights = []
    for index, ((source, design), steps) in enumerate(designs):
        along = steps[["y_fitness", "y_sd", "y_trials"]].to_numpy(float)
        first = steps[["x_fitness", "x_sd", "x_trials"]].to_numpy(float)[:1]
        fitness, sd, trials = np.vstack([first, along]).T
        errors = sd / np.sqrt(trials)
        heights.append(fitness)
        shift = (index - (len(designs) - 1) / 2) * min(_APART, 0.4 / len(designs))
        named = len(designs) <= NAMED
        colour = CATEGORIES[index % len(CATEGORIES)] if named else "0.6"
        label = f"{str(source).rstrip('/').rpartition('/')[2]}: {design}" if named else None
        look: dict[str, Any] = {"lw": 0.8, "marker": "o", "ms": 3.0, "elinewidth": 0.6}
        places = np.arange(len(fitness)) + shift
        axes.errorbar(places, fitness, np.nan_to_num(errors), color=colour, label=label, **look)
    if len(designs) > 1:
        mean = np.mean(heights, axis=0)
        axes.plot(range(len(mean)), mean, color="black", lw=1.8, zorder=4, label="mean")
