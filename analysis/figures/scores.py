"""The fitness of champions, recorded, validated or under common conditions: for comparisons."""

import argparse

import pandas as pd

from ..measures.comparison import MEASURES
from ..tables.quantities import FITNESS
from ..tables.study import Study
from ..tables.validated import score_under, validate_champions


def add_conditions(parser: argparse.ArgumentParser) -> None:
    """Add the option for common conditions."""
    parser.add_argument(
        "--under",
        metavar="NAME",
        help="compare the champions' scores in the evaluations with this name or label instead, "
        "under the same conditions for all",
    )


def score_runs(study: Study, under: str | None) -> tuple[pd.DataFrame, list[str]]:
    """Score the champion of each finished run, and name the columns of the scores.

    Raises:
        InputError: no run is finished, or no evaluation has that name.
    """
    if under is None:
        return validate_champions(study), list(MEASURES)
    return score_under(study, under), [f"under {under}"]


def title_measure(measure: str, label: str = FITNESS) -> str:
    """Name a column of ``score_runs``; ``label`` is what the fitness is called."""
    return f"{measure} {label}" if measure in MEASURES else f"{label} {measure}"
