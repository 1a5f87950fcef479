"""Panels of one or two factors: replicates, means, their intervals, and tests below."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evoros.base.arrays import Array
from evoros.fitness.naming import UNBOUNDED

from ..statistics.comparison import format_p, title_measure
from ..statistics.effect_sizes import contrast_interval
from ..statistics.factorial import Cell
from ..tables.records import FITNESS
from ..tables.treatments import describe_factor, describe_level
from .columns import SMALL, Layout, table_height, write_table
from .style import COLUMN_IN, assign_colours, scale_type, scatter_aside, use_style
from .words import cut_short, wrap, wrap_lines

HEADS = {"effect": (0.0, "left"), "F": (0.66, "right"), "p": (0.81, "right")}
HEADS["p (Holm)"] = (1.0, "right")
EFFECT_LENGTH = 32  # characters of an effect in the table
PANEL_IN = 2.2
LETTERS_PER_IN = 15  # of the labels of axes
LEGEND_LETTERS = 44  # in a line of the legend, beside its marks
PROBABILITIES = ("p", "p_holm")
CROSS, TIMES = " x ", " \N{MULTIPLICATION SIGN} "
"""Between the factors of an interaction, in tables and in figures."""
SPREAD = 0.5  # of the levels of the second factor, beside each other


def draw_factors(
    cells: Mapping[str, Mapping[Cell, Array]],
    names: Sequence[str],
    tests: pd.DataFrame,
    bounds: Mapping[str, tuple[float, float]],
    width: float = COLUMN_IN,
    label: str = FITNESS,
) -> Figure:
    """Draw a panel for each measure, with its tests below: replicates, means and intervals.

    ``bounds`` are the minimum and maximum of each measure. ``width`` is in inches. Levels of the
    first factor are along the axis, levels of the second have colours, and lines between means are
    parallel if there is no interaction.
    """
    lines = max(_wrap_level(level, width, cells).count("\n") for level in _list_first(cells))
    panel_in = PANEL_IN + scale_type(0.13) * lines
    layout = Layout(len(cells), width, panel_in, table_height(len(names) * 2 - 1, note=True))
    with use_style():
        figure, parts = layout.make_figure()
        for (top, bottom), (measure, values) in zip(parts, cells.items(), strict=True):
            axes = top.subplots()
            _draw_means(axes, values, names, bounds.get(measure, UNBOUNDED))
            axes.set_ylabel(wrap(title_measure(measure, label), LETTERS_PER_IN * 0.75 * PANEL_IN))
            first = [_wrap_level(level, width, cells) for level in _list_first(cells)]
            axes.set_xticks(range(len(first)), first, fontsize=SMALL)
            rows = [
                (
                    cut_short(
                        TIMES.join(map(describe_factor, str(row["effect"]).split(CROSS))),
                        EFFECT_LENGTH,
                    ),
                    f"{row['f']:.2f} ({row['df']}, {row['df_error']})",
                    *(format_p(row[name]).removeprefix("p").strip("= ") for name in PROBABILITIES),
                )
                for row in tests[tests.measure == measure].to_dict("records")
            ]
            note = "bars: means with 95 % intervals; p by permutation"
            write_table(bottom, HEADS, rows, layout.table_size, note)
    return figure


def _list_first(cells: Mapping[str, Mapping[Cell, Array]]) -> list[str]:
    """List the levels of the first factor."""
    return list(dict.fromkeys(cell[0] for values in cells.values() for cell in values))


def _wrap_level(level: str, width: float, cells: Mapping[str, Mapping[Cell, Array]]) -> str:
    """Describe a level in lines that fit between the ticks of a panel."""
    panel = width / (2 if width > 1.5 * COLUMN_IN and len(cells) > 1 else 1) - 0.7
    room = LETTERS_PER_IN * panel / len(_list_first(cells))
    return "\n".join(cut_short(line, int(room)) for line in wrap_lines(describe_level(level), room))


def _draw_means(
    axes: Axes, cells: Mapping[Cell, Array], names: Sequence[str], bounds: tuple[float, float]
) -> None:
    """Draw the replicates of each cell as dots, beside their mean and its interval."""
    first, *others = list_levels(cells, names).values()
    second = others[0] if others else [""]
    colours = assign_colours(second)
    step = SPREAD / len(second)
    for j, other in enumerate(second):
        places, means = [], []
        for i, level in enumerate(first):
            values = cells[(level, other) if others else (level,)]
            x = i + (j - (len(second) - 1) / 2) * step
            interval = contrast_interval([values], [1.0])
            aside = 0.4 * step * scatter_aside(values.size)
            axes.scatter(
                x - 0.3 * step + aside, np.sort(values), s=6, c=colours[other], alpha=0.5, lw=0
            )
            ends = np.clip([interval.low, interval.high], *bounds)
            axes.plot([x, x], ends, color=colours[other], lw=1.2)
            places.append(x)
            means.append(interval.value)
        label = f"{describe_factor(names[1])} {describe_level(other)}" if others else None
        axes.plot(places, means, "o-", color=colours[other], ms=4, lw=0.9, label=label)
    axes.set(xlabel=describe_factor(names[0]), xlim=(-0.5, len(first) - 0.5))
    if others:
        place: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0)}
        labels = [str(label) for label in axes.get_legend_handles_labels()[1]]
        beside = 2 * max(map(len, labels)) <= LEGEND_LETTERS
        axes.legend(frameon=False, ncols=2 if beside else 1, **place)


def list_levels(cells: Mapping[Cell, Array], names: Sequence[str]) -> dict[str, list[str]]:
    """List the levels of each factor, in the order of the cells."""
    return {name: list(dict.fromkeys(cell[i] for cell in cells)) for i, name in enumerate(names)}
