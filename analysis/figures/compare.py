"""A comparison of treatments: every replicate, box plots, and pairwise tests."""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from evoros.base.arrays import Array
from evoros.base.errors import shell_line

from ..drawing import style
from ..drawing.sheet import SMALL, Layout, table_height, write_table
from ..statistics import comparison
from ..statistics.small_samples import LEVEL, choose_form, median_interval
from ..statistics.two_samples import TEST, minimum_replicates
from ..subcommands import Product
from ..tables.records import FITNESS, label_fitness
from ..tables.study import Study
from ..tables.validated import (
    BY_EVALUATION,
    BY_RUN,
    find_differences,
    list_unused,
    select_conditions,
)
from .options import add_conditions, score_runs

HELP = "treatments by recorded and validated fitness: tests, effects, intervals"
NEEDS = "finished runs; for tests, at least two treatments with replicates"
FILES = ("compare.csv", "compare_runs.csv")
MAX_TESTS = 30  # maximum number of tests below the figure; longer lists appear only in the table
NAME_LENGTH = 10  # maximum length of a treatment's name in the tests; longer names become letters
LINE_LENGTH = 20  # maximum number of characters in a line of a label
TITLE_LENGTH = 28  # maximum number of characters in a line below an axis
BOX, DOTS = (-0.22, 0.24), (0.18, 0.3)  # offset from the middle of a row, and height
ROW_IN = 0.36
KEY = "box: quartiles, bar: median, dots: runs"
HEADS = {"treatments": (0.0, "left"), "p (Holm)": (0.62, "right"), "A12 [95 %]": (1.0, "right")}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--under`` and ``--without-tables``."""
    add_conditions(parser)
    about = "leave out the tests below the figure"
    parser.add_argument("--without-tables", action="store_true", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the comparison; the tables list the tests and the scores of each run."""
    runs, measures = score_runs(study, options.under)
    width, label = style.figure_width(options.columns), label_fitness(study.records)
    if options.under is None:
        messages = [*_report_sources(runs), *_report_unused(study), *_report_conditions(study)]
    else:
        (measure,) = measures
        known = int(runs[measure].notna().sum())
        what = comparison.title_measure(measure, label)
        messages = [f"{what} is known for {known} of {len(runs)} champions"]
    table = comparison.compare_treatments(runs, measures)
    figure = draw_comparison(runs, table, width, label, not options.without_tables)
    messages = [*messages, *comparison.conclude(table, label)]
    return Product(table, figure, messages, {"compare_runs.csv": runs})


def _report_sources(runs: pd.DataFrame) -> Iterator[str]:
    for source, column in ((BY_EVALUATION, "fresh_trials"), (BY_RUN, "in_run_trials")):
        rows = runs[runs["validated_by"] == source]
        if len(rows):
            trials = ", ".join(f"{count:.0f}" for count in sorted(set(rows[column])))
            name = "evaluations" if source == BY_EVALUATION else "the runs themselves"
            share = f"{len(rows)} of {len(runs)} runs"
            unit = "trial" if trials == "1" else "trials"
            yield f"validated fitness of {share}: from {name}, {trials} {unit}"
    if (runs["validated_by"] != BY_EVALUATION).any():
        yield (
            "to validate on more trials, evaluate the champions under the conditions of their runs "
            "(evoros evaluate like=SWEEP seed=0 trials=40), and add the evaluation's folder here"
        )


def _report_unused(study: Study) -> Iterator[str]:
    for name, parts in list_unused(study).items():
        yield (
            f"{name} validates no run, because it and the runs differ in {' and '.join(parts)}; "
            f"{shell_line('--under', name)} compares all runs in this evaluation"
        )


def _report_conditions(study: Study) -> Iterator[str]:
    conditions = [select_conditions(record) for record in study.records]
    keys = (key for values in conditions for key in find_differences(values, conditions[0]))
    parts = dict.fromkeys(key.split(".")[0] for key in keys)
    parts.pop("design", None)
    if parts:
        yield (
            f"the runs differ in {' and '.join(parts)}, and each was scored under its own "
            f"conditions; a difference in score may come from the conditions, not from the "
            f"designs; --under NAME compares all runs in one evaluation"
        )


def draw_comparison(
    runs: pd.DataFrame,
    table: pd.DataFrame,
    width: float = style.COLUMN_IN,
    label: str = FITNESS,
    with_tests: bool = True,
) -> Figure:
    """Draw one panel per measure: a dot for each run below a box plot, with test results below."""
    names = list(dict.fromkeys(runs["treatment"].astype(str)))
    letters = style.abbreviate(names, NAME_LENGTH)
    full = (name if short == name else f"{short}: {name}" for name, short in letters.items())
    labels = [style.wrap(label, LINE_LENGTH) for label in full]
    measures = list(dict.fromkeys(table["measure"]))
    tests = {name: table[(table["measure"] == name) & (table["b"] != "")] for name in measures}
    most = MAX_TESTS if with_tests else 0
    written = {name: rows for name, rows in tests.items() if 0 < len(rows) <= most}
    row_in = max(ROW_IN, *(0.11 * (label.count("\n") + 1.5) for label in labels))
    heights = (table_height(len(rows), note=True) for rows in written.values())
    lines = max(
        style.wrap(comparison.title_measure(name, label), TITLE_LENGTH).count("\n")
        for name in measures
    )
    panel_in = row_in * len(names) + style.scale_type(0.65 + 0.14 * lines)
    layout = Layout(len(measures), width, panel_in, max(heights, default=0.0))
    with style.use_style():
        figure, parts = layout.make_figure()
        for (top, bottom), measure in zip(parts, measures, strict=True):
            axes = top.subplots()
            axes.set_yticks(range(len(labels)), labels, fontsize=SMALL)
            _draw_panel(axes, runs, measure, names)
            axes.set_xlabel(style.wrap(comparison.title_measure(measure, label), TITLE_LENGTH))
            top.suptitle(KEY, fontsize="small")
            if measure in written:
                rows = _table_rows(written[measure], letters)
                few = bool((written[measure]["least_p_holm"] >= LEVEL).any())
                needed = f"; *too few runs: {minimum_replicates(len(rows))} each needed" * few
                note = f"{TEST}; [ ]: 95 %{needed}"
                write_table(bottom, HEADS, rows, layout.table_size, note)
    return figure


def _draw_panel(axes: Axes, runs: pd.DataFrame, measure: str, names: Sequence[str]) -> None:
    colours = style.assign_colours(names)
    for row, name in enumerate(names):
        values = runs[measure][runs["treatment"].astype(str) == name].dropna().to_numpy(float)
        if values.size:
            _draw_box(axes, row + BOX[0], values)
            aside = row + DOTS[0] + DOTS[1] * style.scatter_aside(values.size)
            look: dict[str, Any] = {"c": colours[name], "lw": 0, "alpha": 0.9, "zorder": 3}
            axes.scatter(np.sort(values), aside, s=8, **look)
            median = median_interval(values)
            value, _, bounds = median.write(choose_form(values)).partition(" ")
            text = f"{value}, n = {values.size}\n{bounds}".rstrip()
            beside = axes.get_yaxis_transform()
            axes.text(1.02, row, text, transform=beside, va="center", fontsize=SMALL)
    axes.use_sticky_edges = False  # dots at the end of a box are not clipped
    axes.set(ylim=(len(names) - 0.45, -0.45))
    axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)


def _draw_box(axes: Axes, y: float, values: Array) -> None:
    q1, median, q3 = np.quantile(values, [0.25, 0.5, 0.75])
    reach = 1.5 * (q3 - q1)  # whiskers end at the last value within
    low, high = values[values >= q1 - reach].min(), values[values <= q3 + reach].max()
    axes.hlines([y, y], [low, q3], [q1, high], color="0.4", lw=0.7, zorder=1)
    axes.barh(y, q3 - q1, BOX[1], left=q1, color="0.9", ec="0.4", lw=0.7, zorder=1)
    axes.vlines(median, y - BOX[1] / 2, y + BOX[1] / 2, color="black", lw=1.4, zorder=2)


def _table_rows(tests: pd.DataFrame, letters: Mapping[str, str]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for row in tests.to_dict("records"):
        mark = "*" if row["least_p_holm"] >= LEVEL else ""
        pair = f"{letters[row['a']]} vs {letters[row['b']]}{mark}"
        p = comparison.format_p(row["p_holm"]).removeprefix("p").removeprefix(" = ").strip()
        rows.append((pair, p, comparison.format_effect(row)))
    return rows
