"""Effects of one or two factors, and their interaction."""

import argparse
import re
from collections.abc import Hashable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.fitness.naming import UNBOUNDED

from ..drawing import style
from ..drawing.sheet import SMALL, Layout, table_height, write_table
from ..statistics.comparison import ask_for_replicates, format_effect, format_p, title_measure
from ..statistics.factorial import (
    Cell,
    EffectTest,
    contrast_interval,
    list_contrasts,
    permute_effects,
)
from ..statistics.small_samples import LEVEL, Interval, describe_shortfalls, holm
from ..statistics.two_samples import MIN_VALUES, TEST
from ..subcommands import Product
from ..tables.factors import follows
from ..tables.records import FITNESS, bound_scores, label_fitness
from ..tables.study import Study
from ..tables.treatments import describe_factor, describe_level
from .options import add_conditions, score_runs

HELP = "the effects of one or two factors and their interaction, with 95 % intervals"
NEEDS = "finished runs with replicates of each combination of levels"
FILES = ("factors.csv", "factors_effects.csv")
TESTS = (
    *("measure", "effect", "replicates", "test", "df", "df_error", "f"),
    *("a12", "a12_low", "a12_high", "p", "p_holm"),
)
EFFECTS = ("measure", "effect", "contrast", "difference", "low", "high")
PLACES = ((0.0, "left"), (0.66, "right"), (0.81, "right"), (1.0, "right"))
EFFECT_LENGTH = 32  # maximum length of an effect's name in the table
LEVEL_LENGTH = 24  # maximum length of a level's name
PANEL_IN = 2.2
LETTERS_PER_IN = 15  # characters per inch of axis labels
LEGEND_LETTERS = 44  # maximum number of characters per legend line, without markers
PROBABILITIES = ("p", "p_holm")
CROSS, TIMES = " x ", " \N{MULTIPLICATION SIGN} "  # separators in tables and in figures
SPREAD = 0.5  # x axis width that the second factor's levels share at each level of the first


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--factors`` and ``--under``."""
    about = "one or two factors; default: the factors that differ between the runs, up to two"
    parser.add_argument("--factors", metavar="A,B", help=about)
    add_conditions(parser)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the mean of each cell; tables list the tests and the differences of means."""
    names = _choose_factors(study, options.factors)
    runs, measures = score_runs(study, options.under)
    levels = {record.name: record.levels for record in study.records}
    for name in names:
        runs[f"level of {name}"] = [levels[run][name] for run in runs["run"]]
    label = label_fitness(study.records)
    bounds = bound_scores((*study.records, *study.evaluations))
    tests: list[dict[str, object]] = []
    effects: list[tuple[object, ...]] = []
    cells: dict[str, dict[Cell, Array]] = {}
    for measure in measures:
        cells[measure] = _group(runs, measure, names)
        tests += list_tests(measure, cells[measure], names)
        contrasts = list_contrasts(cells[measure], list_levels(cells[measure], names), bounds)
        for one in contrasts:
            ends = (one.interval.value, one.interval.low, one.interval.high)
            effects.append((measure, CROSS.join(one.effect), one.text, *ends))
    table = pd.DataFrame(tests, columns=list(TESTS))
    differences = pd.DataFrame(effects, columns=list(EFFECTS))
    figure = draw_factors(cells, names, table, bounds, style.figure_width(options.columns), label)
    methods = ["mean, Student", "difference of means, Welch"]
    if set(table["test"]) - {TEST}:
        methods += ["a factor has an effect", "two factors interact"]
    messages = [*conclude(table, differences, label), *describe_shortfalls(*methods)]
    return Product(table, figure, messages, {"factors_effects.csv": differences})


def _choose_factors(study: Study, wanted: str | None) -> list[str]:
    """Return the named factors, by default all that vary independently of the others."""
    columns = {
        name: tuple(record.levels[name] for record in study.records) for name in study.factors
    }
    chosen = [] if wanted is None else [part.strip() for part in wanted.split(",")]
    for name in columns if wanted is None else ():
        if not follows(columns[name], [columns[known] for known in chosen]):
            chosen.append(name)

    known = all(name in columns for name in chosen)
    if not known or len(set(chosen)) != len(chosen) or not 1 <= len(chosen) <= 2:
        if not columns:
            raise InputError(
                "--factors: no factor differs, because all runs belong to one treatment; add runs "
                "of another treatment"
            )
        typed = "" if wanted is None else f", not {wanted}"
        raise InputError(
            f"--factors: must be one or two factors that differ between the runs "
            f"({', '.join(columns)}){typed}; name one or two, and choose levels of the others with "
            f"--where"
        )
    others = [
        name
        for name, column in columns.items()
        if not follows(column, [columns[factor] for factor in chosen])
    ]
    if others:
        raise InputError(
            f"--factors: the runs also differ in {', '.join(others)}; choose levels of these with "
            f"--where"
        )
    return chosen


def _group(runs: pd.DataFrame, measure: str, names: Sequence[str]) -> dict[Cell, Array]:
    keys = [f"level of {name}" for name in names]
    known = runs[runs[measure].notna()]
    sets = [list(dict.fromkeys(known[key])) for key in keys]
    cells = {}
    for cell in product(*sets):
        rows = np.logical_and.reduce([known[k] == v for k, v in zip(keys, cell, strict=True)])
        values = known[measure][rows].to_numpy(float)
        if not values.size:
            raise InputError(
                f"{measure}: no finished run with {_describe(names, cell)} was found; "
                f"add such runs, or exclude a level with --where"
            )
        cells[cell] = values
    few = next((cell for cell, values in cells.items() if len(values) < 2), None)
    if few:
        raise InputError(
            f"{measure}: {_describe(names, few)} has only one finished run; at least two are "
            f"needed, and {MIN_VALUES} are better; type: evoros -m ... 'seed=range({MIN_VALUES})'"
        )
    return cells


def _describe(names: Sequence[str], cell: Cell) -> str:
    pairs = zip(names, cell, strict=True)
    return ", ".join(f"{describe_factor(name)} {level}" for name, level in pairs)


def list_tests(
    measure: str, cells: Mapping[Cell, Array], names: Sequence[str]
) -> Iterator[dict[str, object]]:
    """Yield the tests of a measure, with columns ``TESTS``: each factor and their interaction."""
    values = np.concatenate(list(cells.values()))
    levels = {
        name: [cell[i] for cell, sample in cells.items() for _ in sample]
        for i, name in enumerate(names)
    }
    tests: list[EffectTest] = permute_effects(values, levels)
    for test, adjusted in zip(tests, holm([test.p for test in tests]), strict=True):
        effect = CROSS.join(test.effect)
        numbers = (test.freedom, test.error_freedom, test.f)
        shift = (test.a12.value, test.a12.low, test.a12.high)
        what = (measure, effect, min(map(len, cells.values())), test.test)
        row = (*what, *numbers, *shift, test.p, adjusted)
        yield dict(zip(TESTS, row, strict=True))


def conclude(tests: pd.DataFrame, effects: pd.DataFrame, label: str = FITNESS) -> Iterator[str]:
    """Yield a conclusion with contrasts for each effect; ``label`` names the fitness."""
    for row in tests.to_dict("records"):
        rows = effects[(effects.measure == row["measure"]) & (effects.effect == row["effect"])]
        shown = "; ".join(
            re.sub(r"\w+", lambda match: describe_level(match[0]), r.contrast)
            + f": {Interval(r.difference, r.low, r.high).write()}"
            for r in rows.itertuples()
        )
        verdict = "an effect" if row["p_holm"] < LEVEL else "no significant effect at the 5 % level"
        words = " and ".join(map(describe_factor, str(row["effect"]).split(CROSS)))
        kind = "interaction of " if CROSS in str(row["effect"]) else ""
        head = f"{title_measure(str(row['measure']), label)}, {kind}{words}"
        result = f"{verdict}: {format_p(row['p_holm'])} ({row['test']}, Holm)"
        if row["test"] == TEST:
            result += f", A12 = {format_effect(row)} (95 % interval)"
            if row["replicates"] < MIN_VALUES:
                result = ask_for_replicates([row["replicates"]], 1)
        yield f"{head}: {result}; differences of means with 95 % intervals: {shown}"


def draw_factors(
    cells: Mapping[str, Mapping[Cell, Array]],
    names: Sequence[str],
    tests: pd.DataFrame,
    bounds: tuple[float, float] = UNBOUNDED,
    width: float = style.COLUMN_IN,
    label: str = FITNESS,
) -> Figure:
    """Draw a panel per measure with replicates, means and intervals, and the tests below."""
    levels, upright = _label_levels(width, cells)
    below = 0.06 * max(map(len, levels)) if upright else 0.13 * max(x.count("\n") for x in levels)
    panel_in = PANEL_IN + style.scale_type(below)
    layout = Layout(len(cells), width, panel_in, table_height(len(names) * 2 - 1, notes=1))
    with style.use_style():
        figure, parts = layout.make_figure()
        for (top, bottom), (measure, values) in zip(parts, cells.items(), strict=True):
            axes = top.subplots()
            _draw_means(axes, values, names, bounds)
            axes.set_ylabel(
                style.wrap(title_measure(measure, label), LETTERS_PER_IN * 0.85 * PANEL_IN)
            )
            turn = 90 if upright else 0
            axes.set_xticks(range(len(levels)), levels, fontsize=SMALL, rotation=turn)
            tested = tests[tests.measure == measure]
            statistic = "F" if tested["a12"].isna().all() else "A12 [95 %]"
            heads = dict(zip(("effect", statistic, "p", "p (Holm)"), PLACES, strict=True))
            rows = [_write_test(row) for row in tested.to_dict("records")]
            note = f"bars: 95 % intervals of means; {tested['test'].iloc[0]}"
            write_table(bottom, heads, rows, layout.table_size, note)
        ends = np.array([top.axes[0].get_ylim() for top, _ in parts])
        for top, _ in parts:  # all measures have the unit of the fitness
            top.axes[0].set_ylim(ends.min(), ends.max())
    return figure


def _write_test(row: Mapping[Hashable, Any]) -> tuple[str, ...]:
    effect = TIMES.join(map(describe_factor, str(row["effect"]).split(CROSS)))
    statistic = Interval(row["a12"], row["a12_low"], row["a12_high"]).write()
    if np.isnan(row["a12"]):
        statistic = f"{row['f']:.2f} ({row['df']}, {row['df_error']:.1f})"
    p = (format_p(row[name]).removeprefix("p").strip("= ") for name in PROBABILITIES)
    return style.cut_short(effect, EFFECT_LENGTH), statistic, *p


def _label_levels(
    width: float, cells: Mapping[str, Mapping[Cell, Array]]
) -> tuple[list[str], bool]:
    """Return the labels of the first factor's levels, and True if they must be upright to fit."""
    first = dict.fromkeys(cell[0] for values in cells.values() for cell in values)
    levels = [*map(describe_level, first)]
    panel = width / (2 if width > 1.5 * style.COLUMN_IN and len(cells) > 1 else 1) - 0.7
    room = LETTERS_PER_IN * panel / len(levels)
    labels = [style.wrap(level, room) for level in levels]
    if max(len(line) for label in labels for line in label.splitlines()) <= room:
        return labels, False
    return [style.cut_short(level, LEVEL_LENGTH) for level in levels], True


def _draw_means(
    axes: Axes, cells: Mapping[Cell, Array], names: Sequence[str], bounds: tuple[float, float]
) -> None:
    first, *others = list_levels(cells, names).values()
    second = others[0] if others else [""]
    colours = style.assign_colours(second)
    step = SPREAD / len(second)
    for j, other in enumerate(second):
        places, means = [], []
        for i, level in enumerate(first):
            values = cells[(level, other) if others else (level,)]
            x = i + (j - (len(second) - 1) / 2) * step
            interval = contrast_interval([values], [1.0], bounds)
            aside = 0.4 * step * style.scatter_aside(values.size)
            axes.scatter(
                x - 0.3 * step + aside, np.sort(values), s=6, c=colours[other], alpha=0.5, lw=0
            )
            axes.plot([x, x], [interval.low, interval.high], color=colours[other], lw=1.2)
            places.append(x)
            means.append(interval.value)
        label = f"{describe_factor(names[1])} {describe_level(other)}" if others else None
        axes.plot(
            places, means, "o-" if others else "o", color=colours[other], ms=4, lw=0.9, label=label
        )
    axes.set(xlabel=describe_factor(names[0]), xlim=(-0.5, len(first) - 0.5))
    if others:
        place: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0)}
        labels = [str(label) for label in axes.get_legend_handles_labels()[1]]
        beside = 2 * max(map(len, labels)) <= LEGEND_LETTERS
        axes.legend(frameon=False, ncols=2 if beside else 1, **place)


def list_levels(cells: Mapping[Cell, Array], names: Sequence[str]) -> dict[str, list[str]]:
    """List the levels of each factor, in the order of the cells."""
    return {name: list(dict.fromkeys(cell[i] for cell in cells)) for i, name in enumerate(names)}
