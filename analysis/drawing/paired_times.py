"""Missions under the same draws in two versions: their times, those not completed aside."""

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from evoros.base.arrays import Array

from ..statistics.regression import MINUS, format_change
from ..tables.paired_missions import BETTER, GAINED, LOST, PROGRESS, SAME, TIME, WORSE
from .columns import SMALL, Layout, table_height, write_table
from .style import BLUE, COLUMN_IN, SKY, VERMILLION, use_style
from .words import cut_short

LOOKS: Mapping[str, tuple[str, str, str, float]] = {
    SAME: ("as before", "o", "0.75", 2.5),
    BETTER: ("better", "^", SKY, 3.0),
    WORSE: ("worse", "v", "#e0a080", 3.0),
    GAINED: ("completed only in B", "^", BLUE, 5.0),
    LOST: ("completed only in A", "v", VERMILLION, 5.0),
}
"""Name, mark, colour and size of each change, the last drawn on top."""
HEADS = {
    "mean of": (0.0, "left"),
    "A": (0.31, "right"),
    "B": (0.44, "right"),
    f"B {MINUS} A [95 %]": (0.83, "right"),
    "p (Holm)": (1.0, "right"),
}
NAMES = {
    "completed": "completed",
    PROGRESS: "progress",
    "collisions": "collisions",
    TIME: "time [s]",
}
BAND = 0.22
"""Width of the band of missions that are not completed, as a share of the axis of times."""
NOTE_LENGTH = 62


def draw_paired_times(
    pairs: pd.DataFrame, tests: pd.DataFrame, sides: Sequence[str], design: str, width: float
) -> Figure:
    """Draw each mission at its times in A and B, with the tests of all worlds below.

    Missions that are not completed are in bands beyond the longest time, the further the less they
    progressed. ``sides`` are the names of A and B. ``width`` is in inches.
    """
    names = [f"{side}: {name}" for side, name in zip("AB", sides, strict=True)]
    note = cut_short(", ".join([*names, *([design] if design else [])]), NOTE_LENGTH)
    rows = [_list_cells(row) for row in tests.to_dict("records")]
    layout = Layout(1, width, 0.98 * COLUMN_IN, table_height(len(rows), note=True))
    with use_style():
        figure, ((top, bottom),) = layout.make_figure()
        axes = top.subplots()
        _draw_pairs(axes, pairs)
        top.legend(loc="outside upper center", frameon=False, ncols=2, columnspacing=1.0)
        write_table(bottom, HEADS, rows, layout.table_size, note.replace("_", " "))
    return figure


def _list_cells(row: Mapping[Hashable, Any]) -> tuple[str, ...]:
    p = "< 0.001" if row["p_holm"] < 0.001 else f"{row['p_holm']:.3f}"
    means = (f"{row[f'mean_{side}']:.3g}" for side in "ab")
    return NAMES[row["quantity"]], *means, format_change(row), p


def _draw_pairs(axes: Axes, pairs: pd.DataFrame) -> None:
    times = pairs[[f"{TIME}_a", f"{TIME}_b"]].to_numpy(float)
    known = times[~np.isnan(times)]
    low, high = (known.min(), known.max()) if known.size else (0.0, 1.0)
    margin = 0.06 * (high - low) or 1.0
    low, high = low - margin, high + margin
    end = high + BAND * (high - low)
    for place in (axes.axvspan, axes.axhspan):
        place(high, end, color="0.94", lw=0, zorder=0)
    axes.plot([low, high], [low, high], color="0.5", lw=0.7, ls=(0, (4, 2)), zorder=1)
    progress = pairs[[f"{PROGRESS}_a", f"{PROGRESS}_b"]].to_numpy(float)
    places = np.where(np.isnan(times), _place_lost(progress, high, end), times)
    for order, (change, (label, mark, colour, size)) in enumerate(LOOKS.items(), 2):
        chosen = places[(pairs["change"] == change).to_numpy()]
        if len(chosen):
            look: dict[str, Any] = {"marker": mark, "color": colour, "ms": size, "mec": "none"}
            text = f"{label} ({len(chosen)})"
            axes.plot(*chosen.T, ls="none", label=text, zorder=order, alpha=0.9, **look)
    _label(axes, bool(known.size), low, high, end)


def _place_lost(progress: Array, high: float, end: float) -> Array:
    """Place missions that are not completed between ``high`` and ``end``."""
    return high + (end - high) * (0.15 + 0.7 * (1 - np.nan_to_num(progress)))


def _label(axes: Axes, known: bool, low: float, high: float, end: float) -> None:
    """Label the axes, with ticks if any time is known."""
    axes.set(xlim=(low, end), ylim=(low, end), aspect="equal")
    axes.set(xlabel="time of completion in A [s]", ylabel="time of completion in B [s]")
    for axis in (axes.xaxis, axes.yaxis):
        ticks = MaxNLocator(5, steps=[1, 2, 5, 10]).tick_values(low, high)
        axis.set_ticks([tick for tick in ticks if known and low <= tick <= high])
    style: dict[str, Any] = {"fontsize": SMALL, "color": "0.4"}
    middle = (low + high) / 2  # along the band that a text names
    axes.text(middle, end, "not completed in B", ha="center", va="bottom", **style)
    axes.text(end, middle, " not completed in A", ha="left", va="center", rotation=270, **style)
