"""Figures 5 to 11 of the 2018 paper on Evo-ROS, numbered as in the paper, for a case study."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import pandas as pd

from evoros.analysis.drawing.style import render
from evoros.analysis.products import make_product as make_one
from evoros.analysis.subcommands import Product, import_subcommand, parse, to_csv
from evoros.analysis.tables.study import Study
from evoros.analysis.tables.validated import classify_failure
from evoros.base.errors import InputError, single_line

HELP = "Figs. 5 to 11 of the 2018 paper, with the paper's numbering"
NEEDS = "the runs of a case study (`experiment=case_study`)"
FILES = ("paper.csv", "figure_NN_NAME.FORMAT", "figure_NN_NAME.csv")
OUTPUT = "paper"
BASELINE, SPATIAL = "none", "spatial"  # failures of the first and third treatment in the paper
Select = Callable[[Study], Study]


@dataclass(frozen=True)
class _PaperFigure:
    number: int
    subcommand: str
    shows: str  # the paper's caption
    select: Select
    columns: int
    options: Sequence[str] = ()


def _keep(failure: str) -> Select:

    def select(study: Study) -> Study:
        kept = study.keep(r for r in study.records if classify_failure(r) == failure)
        if not kept.records:
            raise InputError(f"its runs are missing; add runs with failure={failure}")
        return kept

    return select


def _keep_sample(study: Study) -> Study:
    runs = [record for record in _keep(BASELINE)(study).records if record.finished]
    if not runs:
        raise InputError(f"no run with failure={BASELINE} is finished; resume such a run")
    return study.keep([min(runs, key=lambda record: record.seed)])


FIGURES = (
    _PaperFigure(5, "regions", "where sensors may be placed", _keep(BASELINE), 1),
    _PaperFigure(6, "course", "the course of a mission", lambda study: study, 2),
    _PaperFigure(7, "panel", "champions of the baseline", _keep(BASELINE), 2),
    _PaperFigure(8, "overlay", "champions of the baseline on one rover", _keep(BASELINE), 1),
    _PaperFigure(9, "fitness", "fitness in a replicate of the baseline", _keep_sample, 1),
    _PaperFigure(10, "failure", "areas of spatially correlated failures", _keep(SPATIAL), 2),
    _PaperFigure(11, "panel", "champions with spatial failures", _keep(SPATIAL), 2),
)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw all figures for which the study has runs; report any other figure in one line."""
    files: dict[str, bytes] = {}
    rows, messages = [], []
    for figure in FIGURES:
        try:
            product = _draw(figure, study, options)
        except InputError as error:
            name = f"Fig. {figure.number} ({figure.shows})"
            messages.append(f"{name} is left out: {single_line(error)}")
            continue
        name = f"figure_{figure.number:02d}_{figure.subcommand}"
        assert product.figure is not None  # ensured by _draw
        content = render(product.figure, options.format, letters=options.panel_letters)
        files[f"{name}.{options.format}"] = content
        if product.table is not None:
            files[f"{name}.csv"] = to_csv(product.table)
        rows.append((figure.number, f"{name}.{options.format}", figure.shows))
    if not rows:
        raise InputError("; ".join(messages))
    table = pd.DataFrame(rows, columns=["figure", "file", "shows"])
    return Product(table, messages=messages, files=files)


def _draw(figure: _PaperFigure, study: Study, options: argparse.Namespace) -> Product:
    chosen = parse([figure.subcommand, *map(str, options.folders), *figure.options])
    chosen.columns = options.columns or figure.columns
    product = make_one(import_subcommand(figure.subcommand), figure.select(study), chosen)
    if product.figure is None:
        raise InputError("has no figure")
    return product
