"""Comparison of evolved with random designs: coverage, front arrays, side mounts, redundancy."""

import argparse
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MultipleLocator

from evoros.base.arrays import Array

from ..designs.features import (
    AHEAD_DEG,
    ALL,
    FRONT,
    HEADINGS_DEG,
    SIDE,
    compare_with_random,
    describe_designs,
)
from ..drawing import style
from ..statistics.small_samples import describe_shortfalls
from ..subcommands import Product
from ..tables.champions import read_champion
from ..tables.costs import AXES, add_budget, check_axis, find_span, read_best_within, read_costs
from ..tables.designs import read_initial_sensors
from ..tables.records import Record
from ..tables.study import Study
from .options import add_thresholds, check_thresholds

ONE_ROBOT = True
HELP = "evolved features: coverage, front arrays, side mounts, redundancy, clusters"
NEEDS = "finished runs"
FILES = ("strategies.csv",)
RANDOM = "0.45"  # grey level of random designs
MARKERS = "os^Dvp"
MOST_BANDS = 3  # maximum number of treatments with intervals around the mean profile
NAME_LENGTH = 9  # maximum length of a label below an axis
_GREY = "0.88"  # grey level of boxes for random designs
_DASHES = (0, (3, 1.5))
_LINE = {"color": RANDOM, "lw": 0.6}
_BOX: dict[str, Any] = {
    **{"widths": 0.7, "whis": (5, 95), "showfliers": False, "patch_artist": True},
    "boxprops": {"facecolor": _GREY, "edgecolor": RANDOM, "linewidth": 0.6},
    "medianprops": {"color": RANDOM, "lw": 1.2},
    **{"whiskerprops": _LINE, "capprops": _LINE, "manage_ticks": False},
}
_KEY: list[Artist] = [
    Line2D([], [], color=RANDOM, lw=0.8, ls=_DASHES, label="random designs, mean"),
    Patch(fc=_GREY, ec=RANDOM, lw=0.6, label="random designs: quartiles, 5th and 95th percentiles"),
    Line2D([], [], color=RANDOM, lw=1.4, label="random designs: median, or share"),
    Line2D([], [], color="black", lw=1, marker="_", ms=5, label="champions: mean, 95 % interval"),
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the redundancy thresholds, and a common cost of designs."""
    add_thresholds(parser)
    add_budget(parser)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Compare all champions of a study with random designs."""
    check_thresholds(options)
    check_axis(options)
    study = study.select_finished(read_champion, read_initial_sensors)
    read: Callable[[Record], pd.DataFrame] = read_champion
    about = list[str]()
    if options.axis is not None:
        costs = {record.name: read_costs(record, options.axis) for record in study.records}
        _, budget = find_span(costs, options.axis, options.budget)
        read = partial(read_best_within, axis=options.axis, budget=budget)
        about = [f"these are the best designs after {budget:g} {AXES[options.axis]}, not champions"]
    champions, near = study.gather(read), (options.near_m, options.near_deg)
    table = describe_designs(champions, study.initial, study.rings, *near)
    # Other figures assign colours and letters in the same order, by run.
    order = table.treatment.map(study.treatments.index).sort_values(kind="stable").index
    table = table.loc[order].reset_index(drop=True)
    summary = compare_with_random(table, study.rings)
    figure = draw_strategies(table, summary, style.figure_width(options.columns, 2))
    short = describe_shortfalls("mean, bootstrap")
    return Product(summary, figure, [*about, *report_designs(summary), *short])


def report_designs(summary: pd.DataFrame) -> list[str]:
    """Report on each treatment in one line, and on the clusters among all champions in another."""
    lines = []
    for treatment, rows in summary.groupby("treatment", sort=False):
        measures = rows.set_index("measure")
        clusters = measures.loc["clusters"]
        line = f"{treatment}: {clusters.n} champion{'' if clusters.n == 1 else 's'}; "
        few = np.isnan(clusters.p)
        count = f"{clusters.value:.0f} clusters" if clusters.value > 1 else "no clusters"
        adjusted = not few and clusters.p_holm > clusters.p
        holm = f", {clusters.p_holm:.2g} after Holm" if adjusted else ""
        line += "too few to find clusters" if few else f"{count} (p {clusters.p:.2g}{holm})"
        if treatment != ALL:
            for name in (FRONT, SIDE, "redundant"):
                row = measures.loc[name]
                line += f"; {name} {row.value * row.n:.0f}"
                line += "" if np.isnan(row.random) else f" (random designs {row.random:.0%})"
            if not measures.n_random.max():
                line += "; there are no random designs to compare with"
        lines.append(line)
    return lines


def draw_strategies(
    table: pd.DataFrame, summary: pd.DataFrame, width: float = style.PAGE_IN
) -> Figure:
    """Plot coverage by heading and three features; ``width`` is in inches."""
    treatments = list(dict.fromkeys(table.treatment))
    wide = style.is_wide(width)
    below, across = (1, 3) if wide else (3, 1)
    with style.use_style():
        entries = [*_list_entries(table, treatments), *(_KEY if table.random.any() else _KEY[-1:])]
        rows = -(-len(entries) // (2 if wide else 1))
        heights = [1.9, 2.0 * below + 0.14 * rows]
        figure = Figure(figsize=(width, sum(heights)), layout="constrained")
        parts: Any = figure.subfigures(2, 1, height_ratios=heights)
        axes = parts[0].subplots()
        for treatment, look in style.assign_dashes(treatments).items():
            shown = summary[summary.treatment == treatment]
            _draw_profile(axes, shown, look, len(treatments) <= MOST_BANDS)
        axes.set_xlim(_reach(summary), -_reach(summary))  # puts left headings on the left
        axes.set_ylim(bottom=0)
        axes.xaxis.set_major_locator(MultipleLocator(45))
        axes.set(xlabel="heading [deg], left > 0", ylabel="sensors that\ncover the heading")
        key: dict[str, Any] = {"frameon": False, "handlelength": 2.4, "ncols": 2 if wide else 1}
        parts[1].legend(handles=entries, loc="outside lower center", **key)
        features = parts[1].subplots(below, across, squeeze=False)
        _draw_ahead(features.flat[0], table, summary)
        _draw_rates(features.flat[1], summary, treatments)
        _draw_lost(features.flat[2], table, summary)
    return figure


def _list_entries(table: pd.DataFrame, treatments: Sequence[str]) -> list[Artist]:
    """List the legend entries of the treatments and their bands."""
    entries: list[Artist] = []
    for i, (name, (colour, dashes)) in enumerate(style.assign_dashes(treatments).items()):
        short = _shorten(treatments)[name]
        title = name if short == name else f"{short}: {name}"
        count = int(((table.treatment == name) & ~table.random).sum())
        look: dict[str, Any] = {"color": colour, "ls": dashes, "lw": 1.4, "ms": 3.5}
        label = f"{title} (n = {count}), mean"
        entries.append(Line2D([], [], marker=MARKERS[i % len(MARKERS)], label=label, **look))
    if len(treatments) <= MOST_BANDS:
        colour = style.assign_colours(treatments)[treatments[0]]
        entries.append(Patch(fc=colour, alpha=0.25, label="95 % interval of the mean"))
    return entries


def _shorten(treatments: Sequence[str]) -> dict[str, str]:
    return style.abbreviate(treatments, NAME_LENGTH if len(treatments) <= 4 else 0)


def _draw_profile(
    axes: Axes, summary: pd.DataFrame, look: tuple[str, Any], with_band: bool
) -> None:
    rows, (colour, dashes) = summary[summary.measure == "coverage"], look
    headings = _close(HEADINGS_DEG, 180.0)
    low, high, value, random = (
        _close(rows[name].to_numpy(float)) for name in ("low", "high", "value", "random")
    )
    if with_band:
        axes.fill_between(headings, low, high, color=colour, alpha=0.2, lw=0)
    axes.plot(headings, random, color=RANDOM, lw=0.8, ls=_DASHES, zorder=1)
    axes.plot(headings, value, color=colour, lw=1.4, ls=dashes)


def _reach(summary: pd.DataFrame) -> int:
    rows = summary[summary.measure == "coverage"]
    covered = rows.loc[(rows.value > 0) | (rows.random > 0), "at"].abs().max()
    return 180 if np.isnan(covered) else min(180, 45 * int(np.ceil((covered + 1) / 45)))


def _close(values: Array, end: float | None = None) -> Array:
    return np.append(values, values[0] if end is None else end)


def _draw_ahead(axes: Axes, table: pd.DataFrame, summary: pd.DataFrame) -> None:
    axes.axhline(0.5, color="black", lw=0.6, ls=":")
    _draw_strips(axes, table, "ahead")
    axes.set_ylim(-0.03, 1.25)
    axes.set_yticks([0, 0.25, 0.5, 0.75, 1])
    axes.set_ylabel(f"share of the cones within\n{AHEAD_DEG:.0f} deg of straight ahead")
    counts = summary[summary.measure == FRONT].set_index("treatment")
    for i, (share, n) in enumerate(counts[["value", "n"]].to_numpy(float)):
        axes.text(i, 1.12, f"{share * n:.0f} : {n - share * n:.0f}", ha="center", fontsize="small")
    axes.set_title("front arrays : side mounts")


def _draw_lost(axes: Axes, table: pd.DataFrame, summary: pd.DataFrame) -> None:
    _draw_strips(axes, table, "lost")
    rows = summary[summary.measure == "lost"]
    places = np.arange(len(rows)) + 0.3
    value, errors = _with_errors(rows)
    axes.errorbar(places, value, errors, fmt="_", color="black", lw=1, ms=5)
    axes.set_ylabel("sensors lost to\na blow on one of them")


def _with_errors(rows: pd.DataFrame) -> tuple[Array, list[Array]]:
    value, low, high = (rows[name].to_numpy(float) for name in ("value", "low", "high"))
    return value, [value - low, high - value]


def _draw_strips(axes: Axes, table: pd.DataFrame, measure: str) -> None:
    colours = style.assign_colours(list(dict.fromkeys(table.treatment)))
    for i, (treatment, colour) in enumerate(colours.items()):
        designs = table[table.treatment == treatment].dropna(subset=measure)
        drawn = designs.loc[designs.random, measure].to_numpy(float)
        if drawn.size:
            axes.boxplot([drawn], positions=[i], **_BOX)
        values = np.sort(designs.loc[~designs.random, measure].to_numpy(float))
        marker, aside = MARKERS[i % len(MARKERS)], 0.4 * style.scatter_aside(values.size)
        axes.plot(i + aside, values, marker, color=colour, ms=3.5, mew=0.4, mec="white")
    axes.set_xticks(range(len(colours)), list(_shorten(list(colours)).values()))
    axes.set_xlim(-0.6, len(colours) - 0.4)


def _draw_rates(axes: Axes, summary: pd.DataFrame, treatments: Sequence[str]) -> None:
    rates = summary[summary.measure.isin(["redundant", "pair within"])]
    groups = list(dict.fromkeys(zip(rates.measure, rates["at"].fillna(0.0), strict=True)))
    step = 0.8 / len(treatments)
    for i, (treatment, colour) in enumerate(style.assign_colours(treatments).items()):
        rows = rates[rates.treatment == treatment]
        places = np.arange(len(groups)) - 0.4 + step * (i + 0.5)
        marker, (value, errors) = MARKERS[i % len(MARKERS)], _with_errors(rows)
        bars: dict[str, Any] = {"color": colour, "ms": 3.5, "lw": 0.9, "label": treatment}
        axes.errorbar(places, value, errors, fmt=marker, **bars)
        random = rows.random.to_numpy(float)
        axes.hlines(random, places - step / 2, places + step / 2, color=RANDOM, lw=1.4, zorder=1)
    names = [f"{1000 * radius:.0f}" if radius else "redundant" for _, radius in groups]
    axes.set_xticks(range(len(groups)), names, fontsize="small")
    axes.set_ylim(0, 1.03)
    axes.set_xlabel("redundant pair, or pair within [mm]")
    axes.set_ylabel("share of champions\nwith such a pair")
