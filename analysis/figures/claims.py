"""The user's claims, one per row, with values, intervals and verdicts (``docs/claims.md``)."""

import argparse
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evoros.base.errors import InputError

from ..drawing.style import BLUE, PAGE_IN, VERMILLION, figure_width, is_wide, use_style
from ..statistics.finding import (
    BUILT_IN,
    DEGREES,
    NOT_SUPPORTED,
    NUMBER,
    SHARE,
    SUPPORTED,
    UNKNOWN,
    Finding,
)
from ..statistics.small_samples import describe_shortfalls
from ..subcommands import Product
from ..tables.champions import read_champion
from ..tables.designs import read_initial_sensors
from ..tables.records import Record
from ..tables.study import Study
from ..tables.validated import identify_champion
from .options import add_thresholds, check_thresholds
from .own_claims import judge_own, read_claims

FIRST_ROBOT = True
HELP = "claims with measured values, intervals and verdicts"
NEEDS = "finished runs"
FILES = ("claims.csv",)
READS: tuple[Callable[[Record], object], ...] = (
    identify_champion,
    read_champion,
    read_initial_sensors,
)
"""Readers that must succeed on a run; otherwise, the run is skipped."""
NUMBER_FORMATS = {SHARE: "{:.0%}", DEGREES: "{:.0f}", NUMBER: "{:.2f}"}
SUFFIXES = {SHARE: "", DEGREES: " deg", NUMBER: ""}
MARKS: dict[str, dict[str, Any]] = {
    SUPPORTED: {"marker": "o", "mfc": BLUE, "mec": BLUE},
    NOT_SUPPORTED: {"marker": "X", "mfc": VERMILLION, "mec": VERMILLION},
    UNKNOWN: {"marker": "o", "mfc": "none", "mec": "0.4"},
    BUILT_IN: {"marker": "s", "mfc": "0.7", "mec": "0.4"},
}
SIZE, LINE_IN, GAP_IN = 7.0, 0.125, 0.05  # font size [pt], line height and row gap
PER_IN = 16.5  # characters per inch at this font size
BOLD_PER_IN = 15.0
WIDE = {"measure": 1.85, "measured [95%]": 1.05, "n": 0.28, "against": 0.77, "verdict": 1.05}
WIDE[""] = 2.0
NARROW = {"measure": 1.42, "measured [95%]": 1.04, "verdict": 1.04}  # columns and widths [in]
Rows = list[tuple[list[str], list[list[str]], str]]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--claims`` and the redundancy thresholds."""
    about = "YAML file of claims"
    parser.add_argument("--claims", type=Path, metavar="FILE", help=about)
    add_thresholds(parser)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Judge the claims of a file on all finished runs and on evaluations of their champions."""
    check_thresholds(options)
    if options.claims is None:
        raise InputError("--claims: missing; write a claims file, and add --claims FILE")
    claims = read_claims(options.claims)
    study = study.select_finished(*READS)
    near = (options.near_m, options.near_deg)
    findings = (judge_own(claim, study, near) for claim in claims)
    return tabulate_findings(findings, study, options)


def tabulate_findings(
    findings: Iterable[Finding],
    study: Study,
    options: argparse.Namespace,
    messages: Iterable[str] = (),
) -> Product:
    """Draw findings as a table; after ``messages``, report each finding in one line."""
    table = pd.DataFrame([asdict(finding) for finding in findings])
    figure = draw_claims(table, figure_width(options.columns, 2))
    messages = [*messages, *map(_report, table.itertuples())]
    means = "mean, bootstrap", "difference of means, Welch"
    short = describe_shortfalls(*means, "ratio of sums, bootstrap")
    return Product(table, figure, [*messages, *short])


def _report(row: Any) -> str:
    result = row.why if np.isnan(row.value) else f"{format_value(row)} ({row.why})"
    return f'{row.verdict}: "{row.claim}"; {row.measure}: {result}'


def draw_claims(table: pd.DataFrame, width: float = PAGE_IN) -> Figure:
    """Draw a table of findings; narrow tables have fewer columns. ``width`` is in inches."""
    columns = WIDE if is_wide(width) else NARROW
    scale = width / sum(columns.values())
    sizes = {name: size * scale for name, size in columns.items()}
    rows = _rows(table, sizes, width)
    lines = sum(len(head) + max(map(len, cells)) for head, cells, _ in rows)
    heads = sum(bool(head) for head, _, _ in rows)
    height = (lines + 1) * LINE_IN + (len(rows) + heads + 2) * GAP_IN + 0.06
    with use_style({"font.size": SIZE}):
        figure = Figure(figsize=(width, height))
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        axes.set_xlim(0, width)
        axes.set_ylim(height, 0)
        _write_rows(axes, rows, sizes, width)
    return figure


def format_value(row: Any) -> str:
    """Format the measured value with its interval."""
    form, suffix = NUMBER_FORMATS[row.unit], SUFFIXES[row.unit]
    if np.isnan(row.value):
        return "-"
    text = form.format(row.value)
    if not np.isnan(row.low):
        text += f" [{form.format(row.low)}, {form.format(row.high)}]"
    return text + suffix


def _format_reference(row: Any) -> str:
    form = NUMBER_FORMATS[row.unit]
    parts = [] if np.isnan(row.reference) else [form.format(row.reference)]
    parts += [] if np.isnan(row.random) else [f"random {form.format(row.random)}"]
    return ", ".join(parts + ([] if np.isnan(row.p) else [f"p {row.p:.2g}"]))


def _rows(table: pd.DataFrame, sizes: Mapping[str, float], width: float) -> Rows:
    """Return each row's verdict, with the lines of its claim (if new) and of its other cells."""
    rows: Rows = []
    claim = ""
    for row in table.itertuples():
        texts = {
            "measure": row.measure,
            "measured [95%]": format_value(row),
            "n": row.n,
            "against": _format_reference(row),
            "verdict": row.verdict,
            "": row.why,
        }
        cells = [_wrap(str(texts[name]), size * PER_IN) for name, size in sizes.items()]
        same, claim = str(row.claim) == claim, str(row.claim)
        head = [] if same else _wrap(claim, width * BOLD_PER_IN)
        rows.append((head, cells, str(row.verdict)))
    return rows


def _wrap(text: str, room: float) -> list[str]:
    return textwrap.wrap(text, max(8, int(room))) or [""]


def _write_rows(axes: Axes, rows: Rows, sizes: Mapping[str, float], width: float) -> None:
    starts = 0.04 + np.cumsum([0.0, *sizes.values()])[:-1]
    y = GAP_IN
    for name, x in zip(sizes, starts, strict=True):
        axes.text(x, y, name, va="top", color="0.35")
    y += LINE_IN + GAP_IN
    for head, cells, verdict in rows:
        if head:
            axes.plot([0.02, width - 0.02], [y, y], color="black", lw=0.5)
            y += GAP_IN
            for line in head:
                axes.text(starts[0], y, line, va="top", weight="bold")
                y += LINE_IN
        for name, x, lines in zip(sizes, starts, cells, strict=True):
            marked = name == "verdict"
            if marked:
                axes.plot(x + 0.05, y + 0.05, ms=4, mew=0.7, ls="none", **MARKS[verdict])
            for i, line in enumerate(lines):
                axes.text(x + 0.12 * marked, y + i * LINE_IN, line, va="top")
        y += max(map(len, cells)) * LINE_IN + GAP_IN
