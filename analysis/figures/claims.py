"""The user's claims, a row each: value, interval, verdict; ``docs/claims.md`` has the rules."""

import argparse
from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd

from ..drawing.claims_table import draw_claims, format_value
from ..drawing.style import figure_width
from ..product import Product
from ..statistics.finding import Finding
from ..tables.candidates import read_initial_sensors
from ..tables.champions import read_champion
from ..tables.claims_file import read_claims
from ..tables.matching import identify_champion
from ..tables.records import Record
from ..tables.study import Study
from ..tables.treatments import report_repeated
from .options import add_thresholds, check_thresholds
from .own_claims import judge_own

FIRST_ROBOT = True
READS: tuple[Callable[[Record], object], ...] = (
    identify_champion,
    read_champion,
    read_initial_sensors,
)
"""A run counts if all of them can read it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the file of claims and the thresholds of redundancy."""
    about = "claims of your own, in YAML, instead of the paper's"
    parser.add_argument("--claims", type=Path, metavar="FILE", help=about)
    add_thresholds(parser)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Judge the claims of a file by all finished runs and evaluations of their champions."""
    check_thresholds(options)
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
    """Draw the table of the findings, and report each in a line behind other messages."""
    table = pd.DataFrame([asdict(finding) for finding in findings])
    figure = draw_claims(table, figure_width(options.columns, 2))
    reports = map(_report, table.itertuples())
    return Product(table, figure, [*report_repeated(study.records), *messages, *reports])


def _report(row: Any) -> str:
    return f"{row.verdict}: {row.claim}: {row.measure}: {format_value(row)} ({row.why})"
