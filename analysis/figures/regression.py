"""Two versions of a stack under the same draws: which missions changed, and what that shows."""

import argparse
from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Any

import pandas as pd

from evoros.base.errors import InputError
from evoros.requirement.verdict import UNDECIDED, VIOLATED
from evoros.terminal.console import DONE, NOT_DECIDED, NOT_MET

from ..drawing.paired_times import draw_paired_times
from ..drawing.style import figure_width
from ..product import Product
from ..statistics.comparison import format_p
from ..statistics.regression import (
    ALL_WORLDS,
    BOUNDED,
    compare_missions,
    format_change,
    judge_margins,
)
from ..tables.paired_missions import (
    COMPLETED,
    GAINED,
    LOST,
    QUANTITIES,
    WORSE,
    find_pair,
    list_changes,
    pair_missions,
)
from ..tables.records import Record
from ..tables.study import Study

HELP = "two versions of a stack under the same draws: missions lost and gained, exact tests"
NEEDS = "two evaluations, or two runs, with equal draws: the older one first"
FILES = {
    "regression.csv": "the tests, a row for each design, world and quantity",
    "regression_missions.csv": "a row for each mission, the worst change first",
    "regression_margins.csv": "the results of `--margin`",
}
SHOWN = 5
"""Maximum number of missions whose commands are printed."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the quantities, the margins and the design."""
    about = "test this quantity alone; may be repeated; all"
    parser.add_argument("--of", action="append", choices=QUANTITIES, help=about)
    about = (
        f"require that the mean of {' or '.join(BOUNDED)} falls by less than X in each world, such "
        f"as {COMPLETED}=0.05; may be repeated, and alone decides the exit status"
    )
    parser.add_argument("--margin", action="append", default=[], metavar="QUANTITY=X", help=about)
    about = "of the results of --margin; 0.95"
    parser.add_argument("--confidence", type=float, default=0.95, metavar="C", help=about)
    about = "the design that is drawn, of several; the one with the worst change"
    parser.add_argument("--design", metavar="NAME", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Compare the folders and draw one design; the tables have all."""
    margins = _read_margins(options)
    one, other = find_pair(study)
    pairs = pair_missions(study, one, other)
    tests = compare_missions(pairs, options.of or list(QUANTITIES))
    judged = judge_margins(pairs, margins, options.confidence)
    design = _choose(pairs, options.design)
    figure = draw_paired_times(
        pairs[pairs["design"] == design],
        tests[(tests["design"] == design) & (tests["world"] == ALL_WORLDS)],
        (one.name, other.name),
        f"design {design}" if pairs["design"].nunique() > 1 else "",
        figure_width(options.columns),
    )
    told = tests[(tests["world"] == ALL_WORLDS) | (tests["result"] != "")]
    messages = [*_introduce(one, other, pairs), *map(_describe, told.to_dict("records"))]
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
            f"correct it"
        )
    margins = dict[str, float]()
    for text in options.margin:
        name, _, typed = text.partition("=")
        value = float(typed) if typed.replace(".", "", 1).isdecimal() else 0.0
        if name not in BOUNDED or not 0 < value < 1:
            raise InputError(
                f"--margin {text}: must be {' or '.join(f'{known}=X' for known in BOUNDED)} with X "
                f"greater than 0 and less than 1; correct it"
            )
        margins[name] = value
    return margins


def _choose(pairs: pd.DataFrame, wanted: str | None) -> str:
    names = list(dict.fromkeys(pairs["design"]))
    if wanted not in (None, *names):
        raise InputError(
            f"--design: must be a design of both folders, not {wanted!r}; choose one of "
            f"{', '.join(names)}"
        )
    return wanted or names[0]


def _find_status(judged: pd.DataFrame) -> int:
    results = set(judged["result"])
    if results & {VIOLATED, WORSE}:
        return NOT_MET
    return NOT_DECIDED if UNDECIDED in results else DONE


def _introduce(one: Record, other: Record, pairs: pd.DataFrame) -> Iterator[str]:
    """Say what is compared, and what the numbers cannot show."""
    changes = list_changes(one, other)
    what = f"differ in {', '.join(changes)}" if changes else "have the same configuration"
    yield f"A: {one.name}, B: {other.name}: {len(pairs)} missions under the same draws; they {what}"
    if any(
        key.startswith("requirements.") and key.endswith(".of")
        for key in (*one.values, *other.values)
    ):
        yield (
            "requirements ended an evaluation by its outcomes: a p needs a fixed number of trials, "
            "while a result of --margin holds for any number"
        )


def _describe(row: Mapping[Hashable, Any]) -> str:
    where = f" in {row['world']}" if row["world"] else ""
    counts = f"better in {row['better']}, worse in {row['worse']} of {row['missions']} missions"
    if row["quantity"] == COMPLETED:
        counts = (
            f"both {row['both']:.0f}, only A {row['worse']}, only B {row['better']}, neither "
            f"{row['neither']:.0f}"
        )
    said = row["result"] or "no change shown"
    return (
        f"design {row['design']}{where}, {row['quantity']}: {said}: {row['mean_a']:.3g} to "
        f"{row['mean_b']:.3g}, {format_change(row)}; {counts}; {format_p(row['p_holm'])} (Holm)"
    )


def _describe_margin(row: Mapping[Hashable, Any]) -> str:
    return (
        f"{row['result']}: design {row['design']} in {row['world']}: mean {row['quantity']} falls "
        f"by less than {row['margin']:g}; it changes by {format_change(row)} in {row['trials']} "
        f"trials, each bound with confidence {row['confidence']:g}"
    )


def _list_worst(pairs: pd.DataFrame) -> Iterator[str]:
    """Count the changed missions, and print the commands that fly the worst of them again."""
    counts: Mapping[Hashable, int] = pairs["change"].value_counts().to_dict()
    said: Sequence[str] = [f"{counts.get(name, 0)} {name}" for name in (LOST, GAINED)]
    yield f"missions {' and '.join(said)}, {len(pairs) - counts.get('same', 0)} changed in all"
    for row in pairs[pairs["change"].isin([LOST, WORSE])].head(SHOWN).to_dict("records"):
        yield f"{row['change']}: design {row['design']}, trial {row['trial']} in {row['world']}"
        yield from (f"  again in {side.upper()}: {row[f'replay_{side}']}" for side in "ab")
