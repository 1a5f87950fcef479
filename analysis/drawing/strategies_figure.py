"""The picture of what evolved: coverage by direction, a panel a treatment, and four measures."""

import textwrap
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator

from evoros.base.arrays import Array

from ..measures.coverage import AHEAD_DEG, HEADINGS_DEG
from ..measures.design_features import FRONT
from .style import PAGE_IN, STYLE, letter, treatment_colours

RANDOM = "0.45"
"""The grey of random designs."""
MARKERS = "os^Dvp"
LEAST_IN = 1.6  # the least width of a panel
LONGEST = 9  # characters of a label below an axis


def strategies(table: pd.DataFrame, summary: pd.DataFrame, width: float = PAGE_IN) -> Figure:
    """Coverage by direction, a panel a treatment; below, what the designs are like.

    ``table`` is what ``traits`` gives, ``summary`` what ``compared`` makes of it; ``width`` is in
    inches.
    """
    treatments = list(dict.fromkeys(table.treatment))
    columns = max(1, int(width / LEAST_IN))
    across = min(columns, len(treatments))
    top, below = -(-len(treatments) // across), 1 if columns >= 3 else 3
    with mpl.rc_context(STYLE):
        heights = [1.65 * top + 0.25, 1.9 * below]
        figure = Figure(figsize=(width, sum(heights)), layout="constrained")
        parts: Any = figure.subfigures(2, 1, height_ratios=heights)
        grid = parts[0].subplots(top, across, squeeze=False, sharex=True, sharey=True)
        for axes, treatment in zip(grid.flat, treatments, strict=False):
            _profile(axes, table[table.treatment == treatment], summary, treatment)
            axes.set_title(_title(treatment, treatments, table, 16 * width / across))
        for axes in list(grid.flat)[len(treatments) :]:
            axes.remove()
        grid[0, 0].set_ylim(bottom=0)
        for row in grid:
            row[0].set_ylabel("sensors that\ncover the heading")
        parts[0].legend(
            handles=_KEY,
            loc="outside upper center",
            ncols=3 if columns >= 3 else 2,
            frameon=False,
            handlelength=1.8,
        )
        places = parts[1].subplots(below, 3 // below, squeeze=False)
        _ahead(places.flat[0], table, summary)
        _rates(places.flat[1], summary, treatments)
        _lost(places.flat[2], table, summary)
    return figure


_KEY = [
    Line2D([], [], color="black", lw=1.4, label="champions, mean and 95% interval"),
    Line2D([], [], color="0.75", lw=0.5, label="each champion"),
    Line2D([], [], color=RANDOM, lw=1.2, ls=(0, (3, 1.5)), label="random designs"),
]


def _short(treatments: Sequence[str]) -> dict[str, str]:
    """Names for ticks: letters where the treatments' own are too long."""
    if max(map(len, treatments)) <= LONGEST and len(treatments) <= 4:
        return {name: name for name in treatments}
    return {name: letter(i) for i, name in enumerate(treatments)}


def _title(treatment: str, treatments: Sequence[str], table: pd.DataFrame, room: float) -> str:
    """What a panel shows, broken into lines of ``room`` characters."""
    count = int(((table.treatment == treatment) & ~table.random).sum())
    short = _short(treatments)[treatment]
    name = treatment if short == treatment else f"{short}: {treatment}"
    return "\n".join(textwrap.wrap(f"{name} ({count})", max(12, int(room))))


def _profile(axes: Axes, own: pd.DataFrame, summary: pd.DataFrame, treatment: str) -> None:
    color = treatment_colours(list(dict.fromkeys(summary.treatment)))[treatment]
    rows = summary[(summary.treatment == treatment) & (summary.measure == "coverage")]
    champions = own.loc[~own.random, HEADINGS_DEG].to_numpy(float)
    at, around = _closed(HEADINGS_DEG, 180.0), [_closed(each) for each in champions]
    for each in around:
        axes.plot(at, each, color=color, lw=0.4, alpha=0.35)
    low, high, value, random = (
        _closed(rows[name].to_numpy(float)) for name in ("low", "high", "value", "random")
    )
    axes.fill_between(at, low, high, color=color, alpha=0.25, lw=0)
    axes.plot(at, random, color=RANDOM, lw=1.2, ls=(0, (3, 1.5)))
    axes.plot(at, value, color=color, lw=1.4)
    axes.set_xlim(_reach(summary), -_reach(summary))  # left is on the left
    axes.xaxis.set_major_locator(MultipleLocator(90))
    axes.xaxis.set_minor_locator(MultipleLocator(45))
    axes.tick_params(labelbottom=True)
    axes.set_xlabel("heading [deg], left > 0")


def _reach(summary: pd.DataFrame) -> int:
    """Up to where any design looks [deg], in steps of 45."""
    rows = summary[summary.measure == "coverage"]
    seen = rows.loc[(rows.value > 0) | (rows.random > 0), "at"].abs().max()
    return min(180, 45 * int(np.ceil((seen + 1) / 45))) if seen == seen else 180


def _closed(values: Array, end: float | None = None) -> Array:
    """With the value at -180 deg again at 180."""
    return np.append(values, values[0] if end is None else end)


def _ahead(axes: Axes, table: pd.DataFrame, summary: pd.DataFrame) -> None:
    axes.axhline(0.5, color="black", lw=0.6, ls=":")
    _strips(axes, table, "ahead")
    axes.set_ylim(-0.03, 1.12)
    axes.set_yticks([0, 0.25, 0.5, 0.75, 1])
    axes.set_ylabel(f"share of the cones within\n{AHEAD_DEG:.0f} deg of ahead")
    counts = summary[summary.measure == FRONT].set_index("treatment")
    for i, (share, n) in enumerate(counts[["value", "n"]].to_numpy(float)):
        axes.text(i, 1.03, f"{share * n:.0f} : {n - share * n:.0f}", ha="center", fontsize=7)
    axes.set_title("front arrays : side mounts")


def _lost(axes: Axes, table: pd.DataFrame, summary: pd.DataFrame) -> None:
    _strips(axes, table, "lost")
    rows = summary[summary.measure == "lost"]
    value = rows.value.to_numpy(float)
    errors = [value - rows.low.to_numpy(float), rows.high.to_numpy(float) - value]
    at = np.arange(len(rows)) + 0.3
    axes.errorbar(at, value, errors, fmt="_", color="black", lw=1, ms=5)
    axes.set_ylabel("sensors that a blow to\none of them takes")


def _strips(axes: Axes, table: pd.DataFrame, measure: str) -> None:
    """A point a champion, beside a box of the random designs."""
    colors = treatment_colours(list(dict.fromkeys(table.treatment)))
    for i, (treatment, color) in enumerate(colors.items()):
        own = table[table.treatment == treatment].dropna(subset=measure)
        drawn = own.loc[own.random, measure].to_numpy(float)
        box = {"facecolor": "0.88", "edgecolor": RANDOM, "linewidth": 0.6}
        if drawn.size:
            axes.boxplot(
                [drawn],
                positions=[i],
                widths=0.7,
                whis=(5, 95),
                showfliers=False,
                patch_artist=True,
                boxprops=box,
                medianprops={"color": RANDOM, "lw": 1.2},
                whiskerprops={"color": RANDOM, "lw": 0.6},
                capprops={"color": RANDOM, "lw": 0.6},
                manage_ticks=False,
            )
        values = np.sort(own.loc[~own.random, measure].to_numpy(float))
        aside = 0.09 * (np.arange(values.size) % 3 - 1)
        marker = MARKERS[i % len(MARKERS)]
        axes.plot(i + aside, values, marker, color=color, ms=3.5, mew=0.4, mec="white")
    axes.set_xticks(range(len(colors)), list(_short(list(colors)).values()))
    axes.set_xlim(-0.6, len(colors) - 0.4)


def _rates(axes: Axes, summary: pd.DataFrame, treatments: Sequence[str]) -> None:
    """Shares of champions with their intervals; a line across for the random designs."""
    rates = summary[summary.measure.isin(["redundant", "pair within"])]
    groups = list(dict.fromkeys(zip(rates.measure, rates["at"].fillna(0.0), strict=True)))
    step = 0.8 / len(treatments)
    for i, (treatment, color) in enumerate(treatment_colours(treatments).items()):
        rows = rates[rates.treatment == treatment]
        at = np.arange(len(groups)) - 0.4 + step * (i + 0.5)
        value = rows.value.to_numpy(float)
        errors = [value - rows.low.to_numpy(float), rows.high.to_numpy(float) - value]
        marker = MARKERS[i % len(MARKERS)]
        axes.errorbar(at, value, errors, fmt=marker, color=color, ms=3.5, lw=0.9, label=treatment)
        random = rows.random.to_numpy(float)
        axes.hlines(random, at - step / 2, at + step / 2, color=RANDOM, lw=1.4, zorder=1)
    names = [f"{1000 * at:.0f}\nmm" if at else "redun-\ndant" for _, at in groups]
    axes.set_xticks(range(len(groups)), names)
    axes.set_ylim(0, 1.03)
    axes.set_ylabel("champions with a pair that\nis redundant, or within")
