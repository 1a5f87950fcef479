"""The fitness of champions, recorded, validated or under common conditions: for comparisons."""

import argparse

import pandas as pd

from ..statistics.comparison import MEASURES
from ..tables.study import Study
from ..tables.validated import score_under, validate_champions


def add_conditions(parser: argparse.ArgumentParser) -> None:
    """Add the option for common conditions."""
    about = (
        "compare the champions' scores in the evaluations with this name or label instead, "
        "under the same conditions for all"
    )
    parser.add_argument("--under", metavar="NAME", help=about)


def score_runs(study: Study, under: str | None) -> tuple[pd.DataFrame, list[str]]:
    """Score the champion of each finished run, and name the columns of the scores."""
    if under is None:
        return validate_champions(study), list(MEASURES)
    return score_under(study, under), [f"under {under}"]
