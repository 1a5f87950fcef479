"""The picture of a transfer: each design a dot, between the two scores that it got."""

from collections.abc import Hashable, Mapping
from itertools import count
from math import ceil, factorial
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from ..measures.statistics import LEVEL
from .columns import height_in, write
from .style import COLUMN_IN, STYLE, treatment_colours

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
HEADS = {
    "group": (0.0, "left"),
    "n": (0.3, "right"),
    "rank correlation": (0.36, "left"),
    "mean loss": (0.7, "left"),
}
LEAST = next(n for n in count(2) if 2 / factorial(n) < LEVEL)
"""Designs whose order can be no accident: of n! orders two agree or disagree wholly."""
NOTE = f"*too few designs for a conclusion: {LEAST} or more are needed"
LONGEST = 16
"""Characters of a group in the summary."""


def transfer(table: pd.DataFrame, found: pd.DataFrame, width: float = COLUMN_IN) -> Figure:
    """A panel for each two conditions: dots on the line are as fit here as there.

    ``table`` is of ``scored_twice``, ``found`` of ``summary``; ``width`` is in inches. Bars are
    standard errors over the trials. Below each panel stand n, the rank correlation and the mean
    loss of each group, with their bootstrap intervals.
    """
    panels = list(table.groupby(["x", "y"], sort=False))
    across = min(len(panels), 2) if width > 1.5 * COLUMN_IN else 1
    down = ceil(len(panels) / across)
    groups = list(dict.fromkeys(found["group"].astype(str)))
    most = int(found.groupby(["x", "y"]).size().max())
    few = bool((found["n"] < LEAST).any())
    above, below = 0.9 * COLUMN_IN, height_in(most, few)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(width, (above + below) * down), layout="constrained")
        parts = figure.subfigures(down, across, squeeze=False).ravel()
        for part, ((x, y), own) in zip(parts, panels, strict=False):
            top, bottom = part.subfigures(2, 1, squeeze=False, height_ratios=[above, below]).ravel()
            _panel(top.subplots(), own, groups)
            if any(groups):
                _legend(top)
            those = found[(found["x"] == x) & (found["y"] == y)]
            lines = list(map(_line, those.to_dict("records")))
            write(bottom, HEADS, lines, (width / across, below), NOTE if few else "")
    return figure


def ends(row: Mapping[Hashable, Any], name: str) -> str:
    """An estimate and its interval."""
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    interval = f" [{low:.2f}, {high:.2f}]" if low <= high else ""
    return f"{row[name]:.2f}{interval}"


def _line(row: Mapping[Hashable, Any]) -> tuple[str, ...]:
    name = str(row["group"])
    short = (name or "all") if len(name) <= LONGEST else name[: LONGEST - 3] + "..."
    mark = "*" if row["n"] < LEAST else ""
    return f"{short}{mark}", str(row["n"]), ends(row, "spearman"), ends(row, "loss")


def _panel(axes: Axes, own: pd.DataFrame, groups: list[str]) -> None:
    colours = treatment_colours(groups)
    errors = {side: own[f"{side}_sd"] / np.sqrt(own[f"{side}_trials"]) for side in "xy"}
    for place, group in enumerate(groups):
        those = own["group"].astype(str) == group
        if those.any():
            x, y = own["x_fitness"][those], own["y_fitness"][those]
            bars = {f"{side}err": errors[side][those].fillna(0.0) for side in "xy"}
            axes.errorbar(x, y, **bars, fmt="none", ecolor="0.6", elinewidth=0.6, zorder=1)
            marker = MARKERS[place % len(MARKERS)]
            axes.scatter(x, y, s=11, c=colours[group], marker=marker, lw=0, label=group, zorder=3)
    low, high = _limits(own, errors)
    axes.plot([low, high], [low, high], color="0.3", lw=0.8, ls=(0, (4, 2)), zorder=2)
    axes.set(xlim=(low, high), ylim=(low, high), aspect="equal")
    part = own["between"].iloc[0]
    axes.set(xlabel=f"fitness, {part}: {own['x'].iloc[0]}")
    axes.set(ylabel=f"fitness, {part}: {own['y'].iloc[0]}")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))


def _legend(figure: SubFigure) -> None:
    """Above the panel, as many names in a line as have room."""
    (axes,) = figure.axes
    names = [str(label) for label in axes.get_legend_handles_labels()[1]]
    columns = max(1, min(len(names), int(50 / (max(map(len, names)) + 5))))
    figure.legend(
        loc="outside upper center",
        ncols=columns,
        frameon=False,
        handletextpad=0.1,
        columnspacing=1.0,
        borderpad=0.1,
    )


def _limits(own: pd.DataFrame, errors: Mapping[str, "pd.Series[float]"]) -> tuple[float, float]:
    """The same for both axes, with some room."""
    ends_of = [
        own[f"{side}_fitness"] + sign * errors[side].fillna(0.0)
        for side in "xy"
        for sign in (-1, 1)
    ]
    low, high = min(map(min, ends_of)), max(map(max, ends_of))
    room = 0.04 * (high - low) or 1.0
    return low - room, high + room
