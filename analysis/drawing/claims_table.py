"""A table of claims as a picture, set like one: a line a measure, below the claim that it is of."""

import textwrap
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..measures.finding import DEGREES, NOT_SUPPORTED, NUMBER, SHARE, SUPPORTED, UNKNOWN
from .style import BLUE, PAGE_IN, STYLE, VERMILLION

FORMATS = {SHARE: "{:.0%}", DEGREES: "{:.0f}", NUMBER: "{:.2f}"}
SUFFIXES = {SHARE: "", DEGREES: " deg", NUMBER: ""}
MARKS: dict[str, dict[str, Any]] = {
    SUPPORTED: {"marker": "o", "mfc": BLUE, "mec": BLUE},
    NOT_SUPPORTED: {"marker": "X", "mfc": VERMILLION, "mec": VERMILLION},
    UNKNOWN: {"marker": "o", "mfc": "none", "mec": "0.4"},
}
SIZE, LINE_IN, GAP_IN = 7.0, 0.125, 0.05  # font [pt], height of a line, room between rows
PER_IN = 17.5  # characters of this size in an inch
BOLD_PER_IN = 15.0
WIDE: tuple[tuple[str, float], ...] = (
    ("measure", 1.85),
    ("measured [95%]", 1.05),
    ("n", 0.28),
    ("against", 0.77),
    ("verdict", 1.05),
    ("", 2.0),
)
NARROW: tuple[tuple[str, float], ...] = (
    ("measure", 1.42),
    ("measured [95%]", 1.04),
    ("verdict", 1.04),
)
Rows = list[tuple[list[str], list[list[str]], str]]


def claims_table(table: pd.DataFrame, width: float = PAGE_IN) -> Figure:
    """``table`` has the fields of ``Finding``; with less than a page's width fewer columns."""
    columns = WIDE if width >= PAGE_IN else NARROW
    scale = width / sum(size for _, size in columns)
    sizes = [size * scale for _, size in columns]
    rows = _rows(table, [name for name, _ in columns], sizes, width)
    lines = sum(len(head) + max(map(len, cells)) for head, cells, _ in rows)
    heads = sum(bool(head) for head, _, _ in rows)
    height = (lines + 1) * LINE_IN + (len(rows) + heads + 2) * GAP_IN + 0.06
    with mpl.rc_context({**STYLE, "font.size": SIZE}):
        figure = Figure(figsize=(width, height))
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        axes.set_xlim(0, width)
        axes.set_ylim(height, 0)
        _draw(axes, rows, [name for name, _ in columns], sizes, width)
    return figure


def value_of(row: Any) -> str:
    """The measured value with its interval, as text."""
    form, suffix = FORMATS[row.unit], SUFFIXES[row.unit]
    if np.isnan(row.value):
        return "-"
    text = form.format(row.value)
    if not np.isnan(row.low):
        text += f" [{form.format(row.low)}, {form.format(row.high)}]"
    return text + suffix


def _against(row: Any) -> str:
    """What the rule compares with."""
    parts = [] if np.isnan(row.reference) else [FORMATS[row.unit].format(row.reference)]
    return ", ".join(parts + ([] if np.isnan(row.p) else [f"p {row.p:.2g}"]))


def _rows(table: pd.DataFrame, names: Sequence[str], sizes: Sequence[float], width: float) -> Rows:
    """For each measure the lines of the claim above it, unless they stand there, cells, verdict."""
    rows: Rows = []
    claim = ""
    for row in table.itertuples():
        texts = {
            "measure": row.measure,
            "measured [95%]": value_of(row),
            "n": str(row.n),
            "against": _against(row),
            "verdict": row.verdict,
            "": row.why,
        }
        cells = [
            _wrapped(str(texts[name]), size * PER_IN)
            for name, size in zip(names, sizes, strict=True)
        ]
        same, claim = str(row.claim) == claim, str(row.claim)
        head = [] if same else _wrapped(claim, width * BOLD_PER_IN)
        rows.append((head, cells, str(row.verdict)))
    return rows


def _wrapped(text: str, room: float) -> list[str]:
    return textwrap.wrap(text, max(8, int(room))) or [""]


def _draw(
    axes: Axes, rows: Rows, names: Sequence[str], sizes: Sequence[float], width: float
) -> None:
    starts = 0.04 + np.concatenate([[0.0], np.cumsum(sizes)[:-1]])
    y = GAP_IN
    for name, x in zip(names, starts, strict=True):
        axes.text(x, y, name, va="top", color="0.35")
    y += LINE_IN + GAP_IN
    for head, cells, verdict in rows:
        if head:
            axes.plot([0.02, width - 0.02], [y, y], color="black", lw=0.5)
            y += GAP_IN
            for line in head:
                axes.text(starts[0], y, line, va="top", weight="bold")
                y += LINE_IN
        for name, x, lines in zip(names, starts, cells, strict=True):
            marked = name == "verdict"
            if marked:
                axes.plot(x + 0.05, y + 0.05, ms=4, mew=0.7, ls="none", **MARKS[verdict])
            for i, line in enumerate(lines):
                axes.text(x + 0.12 * marked, y + i * LINE_IN, line, va="top")
        y += max(map(len, cells)) * LINE_IN + GAP_IN
