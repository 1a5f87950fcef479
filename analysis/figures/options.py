"""Options shared by subcommands: redundancy thresholds, common conditions, grouping."""

import argparse
from math import inf

import pandas as pd

from evoros.base.errors import InputError

from ..designs.features import NEAR_DEG, NEAR_M
from ..statistics.comparison import MEASURES
from ..tables.study import Study
from ..tables.validated import score_under, validate_champions

TREATMENT, RUN = "treatment", "run"  # values of ``--by``, the unit over which designs are pooled


def add_thresholds(parser: argparse.ArgumentParser) -> None:
    """Add the redundancy thresholds."""
    about = f"maximum distance between redundant sensors [m]; default: {NEAR_M}"
    parser.add_argument("--near-m", type=float, default=NEAR_M, metavar="M", help=about)
    about = f"maximum angle between redundant sensors [deg]; default: {NEAR_DEG}"
    parser.add_argument("--near-deg", type=float, default=NEAR_DEG, metavar="DEG", help=about)


def check_thresholds(options: argparse.Namespace) -> None:
    """Check that the redundancy thresholds are valid."""
    for key, value in (("--near-m", options.near_m), ("--near-deg", options.near_deg)):
        if not 0 <= value < inf:
            raise InputError(f"{key}: must be 0 or greater, not {value}")


def add_conditions(parser: argparse.ArgumentParser) -> None:
    """Add ``--under``, which compares champions by their scores in named evaluations."""
    about = (
        "compare the champions by their scores in the evaluations with this name or label, "
        "under the same conditions for all"
    )
    parser.add_argument("--under", metavar="NAME", help=about)


def add_grouping(parser: argparse.ArgumentParser) -> None:
    """Add ``--by``, which pools designs by treatment or keeps runs separate."""
    about = (
        f"pool the designs of each {TREATMENT}, or keep each {RUN} separate; default: {TREATMENT}"
    )
    parser.add_argument("--by", choices=(TREATMENT, RUN), default=TREATMENT, help=about)


def group_runs(study: Study, by: str) -> dict[str, list[int]]:
    """Group the indices of runs by treatment or run, ordered by treatment and seed."""
    groups: dict[str, list[int]] = {}
    rank = study.treatments.index
    ordered = sorted(
        enumerate(study.records), key=lambda item: (rank(item[1].treatment), item[1].seed)
    )
    for place, record in ordered:
        groups.setdefault(record.treatment if by == TREATMENT else record.name, []).append(place)
    return groups


def score_runs(study: Study, under: str | None) -> tuple[pd.DataFrame, list[str]]:
    """Score the champion of each finished run; return the table and its score columns."""
    if under is None:
        return validate_champions(study), list(MEASURES)
    return score_under(study, under), [f"under {under}"]
