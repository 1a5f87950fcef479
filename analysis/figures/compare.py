"""Comparison of treatments: all replicates, box plots and pairwise tests."""

import argparse
from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from evoros.base.arrays import Array
from evoros.base.errors import InputError, shell_line

from ..drawing import style
from ..drawing.sheet import SMALL, Layout, table_height, write_table
from ..statistics import comparison
from ..statistics.small_samples import LEVEL, choose_form, median_interval, share_interval
from ..statistics.two_samples import TEST, minimum_replicates
from ..subcommands import Product
from ..tables.costs import AXES, Race, add_budget, check_axis, hold_race
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

HELP = "comparison of treatments by recorded and validated fitness, with tests and effects"
NEEDS = "finished runs; for tests, at least two treatments with replicates"
FILES = ("compare.csv", "compare_runs.csv")
LISTED = 5  # number of tests above which a matrix shows them
MAX_TESTS = 12  # maximum number of rows below the figure; the table lists all tests
HEAD_LENGTH = 4  # maximum length of a treatment name in a matrix
NAME_LENGTH = 10  # length above which treatment names in tests become letters
LINE_LENGTH = 20  # maximum number of characters per line of a label
TITLE_LENGTH = 28  # maximum number of characters per line below an axis
BOX, DOTS = (-0.22, 0.24), (0.18, 0.3)  # offset from the middle of a row, and height
ROW_IN = 0.36
PROFILE_IN = 1.9  # minimum height [in] of panels next to a profile
KEY = "box: quartiles, bar: median, dots: runs"
HEADS = {"treatments": (0.0, "left"), "p (Holm)": (0.62, "right"), "A12 [95 %]": (1.0, "right")}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for scores, the cost of searches, and tests."""
    add_conditions(parser)
    add_budget(parser)
    about = "also compare the shares of runs that reach this fitness by the budget"
    parser.add_argument("--target", type=float, metavar="FITNESS", help=about)
    about = "test only the differences from this treatment; default: all pairs"
    parser.add_argument("--reference", metavar="NAME", help=about)
    about = "leave out the tests below the figure"
    parser.add_argument("--without-tables", action="store_true", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the comparison; tables list the tests, and the scores of each run."""
    label, race = label_fitness(study.records), None
    check_axis(options)
    if options.reference not in (None, *study.treatments):
        raise InputError(
            f"--reference: {options.reference!r} is not a treatment; choose one of "
            f"{', '.join(map(repr, study.treatments))}"
        )
    if options.axis is not None:
        race = hold_race(study, options.axis, options.budget, options.target)
        runs, measures, messages = race.runs, [race.measure], describe_race(race, label)
    else:
        runs, measures = score_runs(study, options.under)
        messages = _report_scores(study, runs, measures, options.under, label)
    table = comparison.compare_treatments(runs, measures, options.reference)
    if race is not None and race.target is not None:
        table = comparison.compare_reached(table, runs, race.reached)
    width = style.figure_width(options.columns)
    tested = not options.without_tables
    figure = draw_comparison(runs, table, width, label, tested, race)
    messages = [*messages, *comparison.conclude(table, label)]
    return Product(table, figure, messages, {"compare_runs.csv": runs})


def _report_scores(
    study: Study, runs: pd.DataFrame, measures: Sequence[str], under: str | None, label: str
) -> list[str]:
    if under is None:
        return [*_report_sources(runs), *_report_unused(study), *_report_conditions(study)]
    (measure,) = measures
    what = comparison.title_measure(measure, label)
    return [f"{what} is known for {runs[measure].notna().sum()} of {len(runs)} champions"]


def describe_race(race: Race, label: str) -> list[str]:
    """Describe a race's costs, and the fraction of runs per treatment that reach the target."""
    start, budget = race.span
    unit = AXES[race.axis]
    lines = [f"{race.measure}: {race.line} {label} from {start:g} to {budget:g} {unit}"]
    for name, costs in _list_reached(race).items():
        share = share_interval(int(costs.count()), len(costs)).write()
        lines.append(
            f"{name}: {costs.count()} of {len(costs)} runs reach {race.target:g} by {budget:g} "
            f"{unit}: {share}"
        )
    return lines


def _list_reached(race: Race) -> "dict[str, pd.Series[float]]":
    if race.target is None:
        return {}
    groups = race.runs.groupby("treatment", sort=False)[race.reached]
    return {str(name): costs for name, costs in groups}


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
    race: Race | None = None,
) -> Figure:
    """Draw a panel per measure with dots of runs, box plots and tests, and a panel of ``race``."""
    names = list(dict.fromkeys(runs["treatment"].astype(str)))
    measures = list(dict.fromkeys(table["measure"]))
    tests = {name: table[(table["measure"] == name) & (table["b"] != "")] for name in measures}
    pairs = max(map(len, tests.values())) if with_tests else 0
    is_matrix = LISTED < pairs == len(names) * (len(names) - 1) / 2
    letters = style.abbreviate(names, HEAD_LENGTH if is_matrix else NAME_LENGTH)
    full = (name if short == name else f"{short}: {name}" for name, short in letters.items())
    labels = [style.wrap(label, LINE_LENGTH) for label in full]
    count = len(names) if is_matrix else pairs
    below = table_height(count, notes=1) if 0 < count <= MAX_TESTS else 0.0
    row_in = max(ROW_IN, *(0.11 * (label.count("\n") + 1.5) for label in labels))
    titles = {
        name: style.wrap(comparison.title_measure(name, label), TITLE_LENGTH) for name in measures
    }
    lines = max(title.count("\n") for title in titles.values())
    panel_in = row_in * len(names) + style.scale_type(0.65 + 0.14 * lines)
    reached = {} if race is None else _list_reached(race)
    panel_in = max(panel_in, PROFILE_IN) if reached else panel_in
    layout = Layout(len(measures) + bool(reached), width, panel_in, below)
    with style.use_style():
        figure, parts = layout.make_figure()
        for (top, bottom), measure in zip(parts, measures, strict=False):
            axes = top.subplots()
            axes.set_yticks(range(len(labels)), labels, fontsize=SMALL)
            _draw_panel(axes, runs, measure, names)
            axes.set_xlabel(titles[measure])
            top.suptitle(KEY, fontsize="small")
            if below and len(tests[measure]):
                write = _write_matrix if is_matrix else _write_pairs
                write(bottom, tests[measure], letters, layout.table_size)
        if race is not None and reached:
            _draw_profile(parts[-1], race, reached)
    return figure


def _write_pairs(
    figure: SubFigure, tests: pd.DataFrame, letters: Mapping[str, str], size: tuple[float, float]
) -> None:
    rows = [
        (f"{letters[row['a']]} vs {letters[row['b']]}{_mark(row)}", *_write_test(row))
        for row in tests.to_dict("records")
    ]
    few = bool((tests["least_p_holm"] >= LEVEL).any())
    needed = f"; *too few runs: {minimum_replicates(int(tests['tests'].max()))} each needed" * few
    write_table(figure, HEADS, rows, size, f"{TEST}; [ ]: 95 %{needed}")


def _write_matrix(
    figure: SubFigure, tests: pd.DataFrame, letters: Mapping[str, str], size: tuple[float, float]
) -> None:
    names = list(letters.values())
    cells = {(name, name): "\N{MINUS SIGN}" for name in names}
    for row in tests.to_dict("records"):
        a, b = letters[row["a"]], letters[row["b"]]
        cells[a, b], cells[b, a] = _write_test(row)[0] + _mark(row), f"{1 - row['a12']:.2f}"
    step = 1 / (len(names) + 0.4)
    heads = {"": (0.0, "left")}
    heads |= {name: (1 - step * (len(names) - i - 1), "right") for i, name in enumerate(names)}
    rows = [(name, *(cells.get((name, other), "") for other in names)) for name in names]
    few = "; *too few runs" * bool((tests["least_p_holm"] >= LEVEL).any())
    write_table(figure, heads, rows, size, f"upper: p (Holm); lower: A12, row over column{few}")


def _mark(row: Mapping[Hashable, Any]) -> str:
    return "*" if row["least_p_holm"] >= LEVEL else ""


def _write_test(row: Mapping[Hashable, Any]) -> tuple[str, str]:
    p = comparison.format_p(row["p_holm"]).removeprefix("p").removeprefix(" = ").strip()
    return p, comparison.format_effect(row)


def _draw_profile(
    parts: tuple[SubFigure, SubFigure], race: Race, reached: "Mapping[str, pd.Series[float]]"
) -> None:
    """Draw the fraction of runs that have reached the target, by cost (Hansen et al. 2021)."""
    top, bottom = parts
    axes, (start, budget) = top.subplots(), race.span
    for place, (name, (colour, dashes)) in enumerate(style.assign_dashes(list(reached)).items()):
        costs, total = np.sort(reached[name].dropna()), len(reached[name])
        shares = np.arange(len(costs) + 1) / total
        steps: dict[str, Any] = {"ds": "steps-post", "lw": 1.2, "ls": dashes, "label": name}
        x, y = [min(start, *costs), *costs, budget], [*shares, shares[-1]]
        axes.plot(x, y, color=colour, **steps)
        share, beside = share_interval(len(costs), total), budget * (1.04 + 0.03 * place)
        axes.vlines(beside, share.low, share.high, color=colour, lw=1.2)
        axes.plot(beside, share.value, "o", color=colour, ms=3)
    axes.set(xlabel=AXES[race.axis], ylabel=f"share of runs\nthat reached {race.target:g}")
    axes.set_ylim(-0.03, 1.03)
    axes.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    top.suptitle("bars: 95 % intervals at the budget", fontsize="small")
    corner: Any = "outside lower center" if top is bottom else "upper center"
    bottom.legend(*axes.get_legend_handles_labels(), loc=corner, frameon=False)


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
    axes.use_sticky_edges = False  # keeps dots at the end of a box unclipped
    axes.set(ylim=(len(names) - 0.45, -0.45))
    axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)


def _draw_box(axes: Axes, y: float, values: Array) -> None:
    q1, median, q3 = np.quantile(values, [0.25, 0.5, 0.75])
    reach = 1.5 * (q3 - q1)  # whiskers end at the last value within this distance
    low, high = values[values >= q1 - reach].min(), values[values <= q3 + reach].max()
    axes.hlines([y, y], [low, q3], [q1, high], color="0.4", lw=0.7, zorder=1)
    axes.barh(y, q3 - q1, BOX[1], left=q1, color="0.9", ec="0.4", lw=0.7, zorder=1)
    axes.vlines(median, y - BOX[1] / 2, y + BOX[1] / 2, color="black", lw=1.4, zorder=2)
