"""Makes a subcommand's product for the chosen robot and mission, with factor columns in tables."""

import argparse
from dataclasses import replace
from typing import Any

import pandas as pd

from evoros.base.errors import InputError

from .subcommands import SUBCOMMANDS, Product, Subcommand, import_subcommand, parse
from .tables.agents import choose_robot
from .tables.study import Study
from .tables.worst_missions import show_worst

OF_COMMAND = {"subcommand", "folders", "where", "treatments", "output", "style", "panel_letters"}
"""Options that choose runs, as the study already does, or that control the written files."""
NAMING = ("treatment", "group", "run")
"""Columns that identify a row's treatment; the first column present is used."""
SIDES = ("a", "b")  # columns of the two treatments in a comparison


def analyze(study: Study, figure: str, **options: Any) -> Product:
    """Make a figure and its tables like ``evoros analyze FIGURE``, but write no files.

    ``figure`` is the name of a subcommand, and ``options`` are its options, spelled with
    underscores: ``without_tables=True``, ``difference=[1.0]``.

    Raises:
        InputError: the figure or an option does not exist, or the study lacks the required data.
    """
    if figure not in SUBCOMMANDS:
        raise InputError(
            f"figure: must be one of {', '.join(SUBCOMMANDS)}, not {figure!r}; choose one"
        )
    parsed = parse([figure, "."])
    known = sorted(set(vars(parsed)) - OF_COMMAND)
    for name, value in options.items():
        if name not in known:
            raise InputError(
                f"{figure}: no option {name!r}; choose from {', '.join(known) or 'no options'}"
            )
        setattr(parsed, name, value)
    return make_product(import_subcommand(figure), study, parsed)


def make_product(subcommand: Subcommand, study: Study, options: argparse.Namespace) -> Product:
    """Make a subcommand's product, with messages that name the mission and the robot shown."""
    chosen, about_mission = getattr(subcommand, "ONE_ROBOT", False), list[str]()
    if getattr(subcommand, "WORST_MISSION", False):
        study, about_mission = show_worst(study, options.run)
    product = _make_for_robot(subcommand, study, options, chosen)
    return replace(product, messages=[*about_mission, *product.messages])


def _make_for_robot(
    subcommand: Subcommand, study: Study, options: argparse.Namespace, chosen: bool
) -> Product:
    if not chosen and not getattr(subcommand, "FIRST_ROBOT", False):
        return _add_all_factors(subcommand.make_product(study, options), study)
    choice = choose_robot(study, options.agent if chosen else None)
    product = _add_all_factors(subcommand.make_product(choice.study, options), choice.study)
    if not choice.others:
        return product
    others = ", ".join(choice.others)
    in_view = getattr(subcommand, "IN_VIEW", False)
    rest = f", with {others} in view" if in_view else f" alone, without {others}"
    about = choice.robot + rest
    if chosen and options.agent is None:
        about = f"{about}; --agent NAME shows another robot"
    return replace(product, messages=[*product.messages, about])


def _add_all_factors(product: Product, study: Study) -> Product:
    table = None if product.table is None else _add_factors(product.table, study)
    tables = {name: _add_factors(further, study) for name, further in product.tables.items()}
    return replace(product, table=table, tables=tables)


def _add_factors(table: pd.DataFrame, study: Study) -> pd.DataFrame:
    """Insert the factor levels of each row's treatment, or of its treatments ``a`` and ``b``.

    If a column name is taken, it gets the prefix ``factor_``; rows that cover several treatments
    have empty cells.
    """
    records = (*study.evaluations, *study.records)  # runs take precedence if labels are equal
    factors = list(dict.fromkeys(name for record in records for name in record.levels))
    columns = list(table.columns)
    named, ends = [name for name in NAMING if name in columns][:1], [""]
    if set(SIDES) <= set(columns):
        named, ends = list(SIDES), [f"_{side}" for side in SIDES]
    keys = {
        key: record.levels
        for record in records
        for key in ((record.name,) if named == ["run"] else (record.treatment,))
    }
    table = table.copy(deep=False)
    place = max((columns.index(name) for name in named), default=0) + 1
    for factor in factors:
        for column, end in zip(named, ends, strict=False):
            levels = [keys.get(str(key), {}).get(factor, "") for key in table[column]]
            if any(levels):
                taken = f"{factor}{end}" in table.columns
                table.insert(place, f"factor_{factor}{end}" if taken else f"{factor}{end}", levels)
                place += 1
    return table
