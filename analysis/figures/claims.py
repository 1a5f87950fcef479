"""The paper's claims, a row each: the measured value, its interval, and a verdict by a rule.

``docs/claims.md`` describes the measures and the rules.
"""

import argparse
import textwrap
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..drawing.style import BLUE, PAGE_IN, VERMILLION, figure_width, is_wide, use_style
from ..measures import claims_designs, claims_runs
from ..measures.coverage import DESIGN, HEADINGS_DEG
from ..measures.design_features import describe_designs
from ..measures.finding import (
    DEGREES,
    NOT_SUPPORTED,
    NUMBER,
    SHARE,
    SUPPORTED,
    UNKNOWN,
    Finding,
)
from ..measures.heading_swing import read_champion_swings
from ..measures.pairs import paper_rings
from ..measures.spread import read_diversity
from ..product import Product
from ..tables.candidates import read_initial_sensors
from ..tables.champion_missions import classify_failure, list_missions
from ..tables.designs import read_champion
from ..tables.matching import identify_champion
from ..tables.records import Record
from ..tables.study import Study
from ..tables.treatments import report_repeated
from .thresholds import add_arguments, check_thresholds

__all__ = ["HELP", "add_arguments", "draw_claims", "make_product"]
FIRST_ROBOT = True
HELP = "the paper's claims: measured values, their intervals, and which claims they support"
READS: tuple[Callable[[Record], object], ...] = (
    identify_champion,
    read_champion,
    read_initial_sensors,
    read_champion_swings,
    read_diversity,
    claims_runs.read_gains,
)
"""A run counts if all of them can read it."""
_NO_DESIGNS = pd.DataFrame(
    columns=[*DESIGN, "random", "strategy", "redundant", "closest_m", "kind", *HEADINGS_DEG]
).astype({"random": bool, "redundant": bool})
NUMBER_FORMATS = {SHARE: "{:.0%}", DEGREES: "{:.0f}", NUMBER: "{:.2f}"}
SUFFIXES = {SHARE: "", DEGREES: " deg", NUMBER: ""}
MARKS: dict[str, dict[str, Any]] = {
    SUPPORTED: {"marker": "o", "mfc": BLUE, "mec": BLUE},
    NOT_SUPPORTED: {"marker": "X", "mfc": VERMILLION, "mec": VERMILLION},
    UNKNOWN: {"marker": "o", "mfc": "none", "mec": "0.4"},
}
SIZE, LINE_IN, GAP_IN = 7.0, 0.125, 0.05  # font [pt], height of a line, room between rows
PER_IN = 16.5  # characters of this size in an inch
BOLD_PER_IN = 15.0
WIDE = {"measure": 1.85, "measured [95%]": 1.05, "n": 0.28, "against": 0.77, "verdict": 1.05}
WIDE[""] = 2.0
NARROW = {"measure": 1.42, "measured [95%]": 1.04, "verdict": 1.04}
"""Columns and their widths [in]."""
Rows = list[tuple[list[str], list[list[str]], str]]


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Judge the claims by all finished runs of the study and evaluations of their champions."""
    check_thresholds(options)
    study = study.select_finished(*READS)
    table = pd.DataFrame([asdict(finding) for finding in judge_claims(study, options)])
    figure = draw_claims(table, figure_width(options.columns, 2))
    repeated = report_repeated((r.name, r.treatment, r.seed) for r in study.records)
    findings = map(_report, table.itertuples())
    return Product(table, figure, [*repeated, *_report_pooled(study), *findings])


def judge_claims(study: Study, options: argparse.Namespace) -> Iterator[Finding]:
    """Judge all claims by the finished runs of a study."""
    mirrored = study.keep(record for record in study.records if record.context.mirrored)
    free = study.keep(record for record in study.records if not record.context.mirrored)
    designs, free_designs = _describe(mirrored, options), _describe(free, options)
    yield claims_designs.judge_configurations(designs)
    yield claims_designs.judge_redundancy(designs)
    for ring in study.rings or paper_rings():
        yield claims_designs.judge_damage_clusters(designs, ring.radius_m)
    gains = _gather(mirrored, claims_runs.read_gains)
    for line in claims_runs.GAIN:
        yield claims_runs.judge_gain(gains, line)
    yield claims_runs.judge_approach(gains)
    yield claims_runs.judge_heading_swing(_gather(mirrored, read_champion_swings))
    yield from claims_runs.judge_completion(list_missions(study))
    kinds = set(map(classify_failure, free.records))
    comparable = mirrored.keep(r for r in mirrored.records if classify_failure(r) in kinds)
    yield claims_designs.judge_spread_between(designs[designs.kind.isin(kinds)], free_designs)
    diversity = (_gather(part, read_diversity) for part in (comparable, free))
    yield claims_designs.judge_spread_within(*diversity)


def _gather(study: Study, read: Callable[[Record], pd.DataFrame]) -> pd.DataFrame:
    """Gather the tables of all runs; the table is empty if no run has rows."""
    if any(len(read(record)) for record in study.records):
        return study.gather(read)
    return pd.DataFrame(columns=["first", "last"])


def _describe(study: Study, options: argparse.Namespace) -> pd.DataFrame:
    """Describe champions and random designs, with the kind of their failure."""
    if not study.records:
        return _NO_DESIGNS
    champions, initial = study.gather(read_champion), study.gather(read_initial_sensors)
    near = options.near_m, options.near_deg
    table = describe_designs(champions, initial, study.rings, *near)
    kinds = {record.name: classify_failure(record) for record in study.records}
    return table.assign(kind=table.run.map(kinds))


def _report_pooled(study: Study) -> Iterator[str]:
    """Report each kind of failure whose runs are of several treatments."""
    mirrored = [record for record in study.records if record.context.mirrored]
    for kind in dict.fromkeys(map(classify_failure, mirrored)):
        labels = dict.fromkeys(r.treatment for r in mirrored if classify_failure(r) == kind)
        if len(labels) > 1:
            yield f"failure {kind}: runs of several treatments are pooled: {'; '.join(labels)}"


def _report(row: Any) -> str:
    return f"{row.verdict}: {row.claim}: {row.measure}: {_format_value(row)} ({row.why})"


def draw_claims(table: pd.DataFrame, width: float = PAGE_IN) -> Figure:
    """Draw a table with the fields of ``Finding``; below a page's width it has fewer columns.

    ``width`` is in inches.
    """
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


def _format_value(row: Any) -> str:
    """Format the measured value with its interval."""
    form, suffix = NUMBER_FORMATS[row.unit], SUFFIXES[row.unit]
    if np.isnan(row.value):
        return "-"
    text = form.format(row.value)
    if not np.isnan(row.low):
        text += f" [{form.format(row.low)}, {form.format(row.high)}]"
    return text + suffix


def _format_reference(row: Any) -> str:
    """Format the values with which the rule compares."""
    parts = [] if np.isnan(row.reference) else [NUMBER_FORMATS[row.unit].format(row.reference)]
    return ", ".join(parts + ([] if np.isnan(row.p) else [f"p {row.p:.2g}"]))


def _rows(table: pd.DataFrame, sizes: Mapping[str, float], width: float) -> Rows:
    """Return for each measure the lines of a new claim, the lines of its cells, its verdict."""
    rows: Rows = []
    claim = ""
    for row in table.itertuples():
        texts = {
            "measure": row.measure,
            "measured [95%]": _format_value(row),
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
