"""Two versions of a software stack on the same random draws: changed missions and tests."""

import argparse
from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from evoros.base.errors import InputError
from evoros.requirement.verdict import UNDECIDED, VIOLATED
from evoros.terminal.console import DONE, NOT_DECIDED, NOT_MET

from ..drawing.sheet import SMALL, Layout, table_height, write_table
from ..drawing.style import BLUE, COLUMN_IN, SKY, VERMILLION, cut_short, figure_width, use_style
from ..statistics.comparison import format_p
from ..statistics.regression import (
    ALL_WORLDS,
    BOUNDED,
    MINUS,
    compare_missions,
    format_change,
    judge_margins,
)
from ..statistics.small_samples import describe_shortfalls
from ..subcommands import Product
from ..tables.pairs import (
    BETTER,
    COMPLETED,
    GAINED,
    LOST,
    PROGRESS,
    QUANTITIES,
    SAME,
    TIME,
    WORSE,
    find_pair,
    list_changes,
    pair_missions,
)
from ..tables.records import Record
from ..tables.study import Study

HELP = "two software versions on the same draws: new failures, new completions, p-values"
NEEDS = "two evaluations or two runs with the same draws, the older one first"
FILES = ("regression.csv", "regression_missions.csv", "regression_margins.csv")
SKEWED = ("change in completion time, bootstrap", "paired values change (sign-flip test)")
SHOWN = 5  # maximum number of missions with a printed replay command
LOOKS: Mapping[str, tuple[str, str, str, float]] = {
    SAME: ("unchanged, time within 1 %", "o", "0.75", 2.5),
    BETTER: ("better", "^", SKY, 3.0),
    WORSE: ("worse", "v", "#e0a080", 3.0),
    GAINED: ("completed only in B", "^", BLUE, 5.0),
    LOST: ("completed only in A", "v", VERMILLION, 5.0),
}
"""Name, marker, colour and size for each kind of change; the last kind is drawn on top."""
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
BAND = 0.22  # width of the band for incomplete missions, as a fraction of the time axis
NOTE_LENGTH = 62


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for quantities, margins and design."""
    about = "test only this quantity; may be repeated; default: all"
    parser.add_argument("--of", action="append", choices=QUANTITIES, help=about)
    about = (
        f"require that the mean of {' or '.join(BOUNDED)} falls by less than X in each world, "
        f"for example {COMPLETED}=0.05; may be repeated; the exit status then depends only on "
        "these margins"
    )
    parser.add_argument("--margin", action="append", default=[], metavar="QUANTITY=X", help=about)
    about = "confidence level of the --margin results; default: 0.95"
    parser.add_argument("--confidence", type=float, default=0.95, metavar="C", help=about)
    about = "the design to draw; default: the one with the worst change"
    parser.add_argument("--design", metavar="NAME", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Compare the folders and draw one design; tables cover all designs."""
    margins = _read_margins(options)
    one, other = find_pair(study)
    pairs = pair_missions(study, one, other)
    tests = compare_missions(pairs, options.of or list(QUANTITIES))
    judged = judge_margins(pairs, margins, options.confidence)
    design = _choose(pairs, options.design)
    figure = _draw_paired_times(
        pairs[pairs["design"] == design],
        tests[(tests["design"] == design) & (tests["world"] == ALL_WORLDS)],
        (one.name, other.name),
        f"design {design}" if pairs["design"].nunique() > 1 else "",
        figure_width(options.columns),
    )
    told = tests[(tests["world"] == ALL_WORLDS) | tests["result"].isin([BETTER, WORSE])]
    messages = [*_introduce(one, other, pairs), *map(_describe, told.to_dict("records"))]
    messages += describe_shortfalls(*SKEWED) if set(told["quantity"]) - {COMPLETED} else []
    messages += [*map(_describe_margin, judged.to_dict("records")), *_list_worst(pairs)]
    tables = {"regression_missions.csv": pairs}
    if margins:
        tables["regression_margins.csv"] = judged
    status = _find_status(judged if margins else tests)
    return Product(tests, figure, messages, tables, status=status)


def _read_margins(options: argparse.Namespace) -> dict[str, float]:
    if not 0 < options.confidence < 1:
        raise InputError(
            f"--confidence: must be greater than 0 and less than 1, not {options.confidence}; "
            f"type --confidence 0.95, for example"
        )
    margins = dict[str, float]()
    for text in options.margin:
        name, _, typed = text.partition("=")
        value = float(typed) if typed.replace(".", "", 1).isdecimal() else 0.0
        if name not in BOUNDED or not 0 < value < 1:
            raise InputError(
                f"--margin {text}: must be {' or '.join(f'{known}=X' for known in BOUNDED)} with X "
                f"greater than 0 and less than 1; type {COMPLETED}=0.05, for example"
            )
        margins[name] = value
    return margins


def _choose(pairs: pd.DataFrame, wanted: str | None) -> str:
    names = list(dict.fromkeys(pairs["design"]))
    if wanted not in (None, *names):
        raise InputError(
            f"--design: {wanted!r} is not a design in both folders; choose one of "
            f"{', '.join(names)}"
        )
    return wanted or names[0]


def _find_status(judged: pd.DataFrame) -> int:
    results = set(judged["result"])
    if results & {VIOLATED, WORSE}:
        return NOT_MET
    return NOT_DECIDED if UNDECIDED in results else DONE


def _introduce(one: Record, other: Record, pairs: pd.DataFrame) -> Iterator[str]:
    changes = list_changes(one, other)
    what = f"differ in {', '.join(changes)}" if changes else "have the same configuration"
    about = f"A: {one.name}, B: {other.name}: {len(pairs)} missions on the same random draws"
    yield f"{about}; the folders {what}"
    if any(
        key.startswith("requirements.") and key.endswith(".of")
        for key in (*one.values, *other.values)
    ):
        yield "requirements may stop an evaluation early and invalidate p-values, but not --margin"


def _describe(row: Mapping[Hashable, Any]) -> str:
    where = f" in {row['world']}" if row["world"] else ""
    counts = f"better in {row['better']}, worse in {row['worse']} of {row['missions']} missions"
    if row["quantity"] == COMPLETED:
        counts = (
            f"both {row['both']:.0f}, only A {row['worse']}, only B {row['better']}, neither "
            f"{row['neither']:.0f}"
        )
    said = row["result"] or "no significant change"
    alone = row["quantity"] == COMPLETED and row["trials"] == row["missions"]
    test = "McNemar's test" if alone else "sign permutation test over trials"
    return (
        f"design {row['design']}{where}, {row['quantity']}: {said}: {row['mean_a']:.3g} to "
        f"{row['mean_b']:.3g}, {format_change(row)}; {counts}; "
        f"{format_p(row['p_holm'])} ({test}, Holm)"
    )


def _describe_margin(row: Mapping[Hashable, Any]) -> str:
    return (
        f"{row['result']}: design {row['design']} in {row['world']}: mean {row['quantity']} must "
        f"fall by less than {row['margin']:g}; it changes by {format_change(row)} in "
        f"{row['trials']} trials (each bound at confidence {row['confidence']:g})"
    )


def _list_worst(pairs: pd.DataFrame) -> Iterator[str]:
    counts: Mapping[Hashable, int] = pairs["change"].value_counts().to_dict()
    said: Sequence[str] = [f"{counts.get(name, 0)} {name}" for name in (LOST, GAINED)]
    yield f"missions: {', '.join(said)}, {len(pairs) - counts.get('same', 0)} changed in total"
    for row in pairs[pairs["change"].isin([LOST, WORSE])].head(SHOWN).to_dict("records"):
        yield f"{row['change']}: design {row['design']}, trial {row['trial']} in {row['world']}"
        yield from (f"  replay in {side.upper()}: {row[f'replay_{side}']}" for side in "ab")


def _draw_paired_times(
    pairs: pd.DataFrame, tests: pd.DataFrame, sides: Sequence[str], design: str, width: float
) -> Figure:
    names = [f"{side}: {name}" for side, name in zip("AB", sides, strict=True)]
    note = cut_short(", ".join([*names, *([design] if design else [])]), NOTE_LENGTH)
    rows = [_list_cells(row) for row in tests.to_dict("records")]
    layout = Layout(1, width, 0.98 * COLUMN_IN, table_height(len(rows), notes=1))
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
    # Missions with less progress are farther out in the band.
    progress = pairs[[f"{PROGRESS}_a", f"{PROGRESS}_b"]].to_numpy(float)
    lost = high + (end - high) * (0.15 + 0.7 * (1 - np.nan_to_num(progress)))
    places = np.where(np.isnan(times), lost, times)
    for order, (change, (label, mark, colour, size)) in enumerate(LOOKS.items(), 2):
        chosen = places[(pairs["change"] == change).to_numpy()]
        if len(chosen):
            look: dict[str, Any] = {"marker": mark, "color": colour, "ms": size, "mec": "none"}
            text = f"{label} ({len(chosen)})"
            axes.plot(*chosen.T, ls="none", label=text, zorder=order, alpha=0.9, **look)
    _label(axes, bool(known.size), low, high, end)


def _label(axes: Axes, known: bool, low: float, high: float, end: float) -> None:
    axes.set(xlim=(low, end), ylim=(low, end), aspect="equal")
    axes.set(xlabel="completion time in A [s]", ylabel="completion time in B [s]")
    for axis in (axes.xaxis, axes.yaxis):
        ticks = MaxNLocator(5, steps=[1, 2, 5, 10]).tick_values(low, high)
        axis.set_ticks([tick for tick in ticks if known and low <= tick <= high])
    style: dict[str, Any] = {"fontsize": SMALL, "color": "0.4"}
    middle = (low + high) / 2  # centre of the bands' labels
    axes.text(middle, end, "not completed in B", ha="center", va="bottom", **style)
    axes.text(end, middle, " not completed in A", ha="left", va="center", rotation=270, **style)
