"""What evolved: where designs look, front arrays or side mounts, redundancy, what one blow takes.

Everything is compared with the random designs that the runs began with.
"""

import argparse
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd

from evoros.base.errors import InputError
from evoros.storage.figure_context import Ring

from ..drawing.strategies_figure import strategies
from ..drawing.style import width as width_of
from ..measures.design_features import ALL, FRONT, SIDE, compared, traits
from ..measures.pairs import NEAR_DEG, NEAR_M
from ..product import Product
from ..tables.designs import champion_or_none, initial_sensors
from ..tables.records import Record
from ..tables.study import Study
from ..tables.treatments import repeated

HELP = "what evolved: coverage by direction, front arrays or side mounts, redundancy, clusters"
__all__ = ["HELP", "arguments", "product", "strategies"]


def arguments(parser: argparse.ArgumentParser) -> None:
    """From when on two sensors are called redundant."""
    parser.add_argument(
        "--near-m", type=float, default=NEAR_M, metavar="M", help=f"redundant up to; {NEAR_M}"
    )
    parser.add_argument(
        "--near-deg", type=float, default=NEAR_DEG, metavar="DEG", help=f"and up to; {NEAR_DEG}"
    )


def product(study: Study, options: argparse.Namespace) -> Product:
    """Of all champions in the study."""
    check_near(options)
    study = finished(study, champion_or_none, initial_sensors)
    rings = damage(study)
    champions = study.gather(champion_or_none)
    table = traits(champions, study.initial, rings, options.near_m, options.near_deg)
    summary = compared(table, rings)
    figure = strategies(table, summary, width_of(options.columns, 2))
    again = repeated((each.name, each.treatment, each.seed) for each in study.records)
    return Product(summary, figure, [*again, *_said(summary)])


def check_near(options: argparse.Namespace) -> None:
    """The thresholds of redundancy must be usable.

    Raises:
        InputError: one is not.
    """
    for key, value in (("--near-m", options.near_m), ("--near-deg", options.near_deg)):
        if not 0 <= value < np.inf:
            raise InputError(f"{key}: must be a number of at least 0, not {value}; correct it")


def finished(study: Study, *reads: Callable[[Record], object]) -> Study:
    """With the finished runs of which all of this can be read; what is left out is said once.

    Raises:
        InputError: there is none.
    """

    def tried(record: Record) -> pd.DataFrame:
        if not record.finished:
            raise InputError(
                f"{record.path}: must be finished, to have a champion, and is not; resume it"
            )
        for read in reads:
            read(record)
        return pd.DataFrame({"whole": [True]})

    names = set(study.gather(tried).run)
    return replace(study, records=tuple(each for each in study.records if each.name in names))


def damage(study: Study) -> tuple[Ring, ...]:
    """The rings of the first run with spatial damage; none: the paper's are meant."""
    return next((record.setting.rings for record in study.records if record.setting.rings), ())


def _said(summary: pd.DataFrame) -> list[str]:
    """A line a treatment, and one for the clusters of all."""
    lines = []
    for treatment, rows in summary.groupby("treatment", sort=False):
        measures = rows.set_index("measure")
        clusters = measures.loc["clusters"]
        words = f"{treatment}: {clusters.n} champion{'' if clusters.n == 1 else 's'}; "
        few = np.isnan(clusters.p)
        count = f"{clusters.value:.0f} clusters" if clusters.value > 1 else "no clusters"
        corrected = not few and clusters.p_holm > clusters.p
        holm = f", {clusters.p_holm:.2g} after Holm" if corrected else ""
        words += "too few for clusters" if few else f"{count} (p {clusters.p:.2g}{holm})"
        if treatment != ALL:
            for name in (FRONT, SIDE, "redundant"):
                row = measures.loc[name]
                words += f"; {name} {row.value * row.n:.0f} (random designs {row.random:.0%})"
        lines.append(words)
    return lines
