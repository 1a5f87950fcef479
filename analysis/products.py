"""Makes products of subcommands for the selected robot and mission, with factors in tables."""

import argparse
from dataclasses import replace
from typing import Any

import pandas as pd

from evoros.base.errors import InputError

from .subcommands import SUBCOMMANDS, Product, Subcommand, import_subcommand, parse
from .tables.agents import choose_robot
from .tables.shown import show_worst
from .tables.study import Study

OF_COMMAND = {"subcommand", "folders", "where", "treatments", "output", "style", "panel_letters"}
NAMING = ("treatment", "group", "run")  # columns that name a treatment; the first present is used
SIDES = ("a", "b")  # columns of the two treatments in a comparison


def analyze(study: Study, figure: str, **options: Any) -> Product:
    """Make a figure and its tables as ``evoros analyze FIGURE`` would, without writing files.

    ``figure`` is the name of a subcommand, and ``options`` are its options with underscores in
    place of hyphens: ``without_tables=True``, ``difference=[1.0]``.

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
    """Make a product, with messages that name the mission and the robot shown."""
    about_mission, about_robot = list[str](), list[str]()
    if getattr(subcommand, "WORST_MISSION", False):
        study, about_mission = show_worst(study, options.run)
    chosen = getattr(subcommand, "ONE_ROBOT", False)
    if chosen or getattr(subcommand, "FIRST_ROBOT", False):
        study, robot, others = choose_robot(study, options.agent if chosen else None)
        if others:
            seen = getattr(subcommand, "IN_VIEW", False)
            form = "{}, with {} in view" if seen else "{} alone, without {}"
            hint = "; --agent NAME shows another robot" * (chosen and options.agent is None)
            about_robot = [form.format(robot, ", ".join(others)) + hint]
    product = subcommand.make_product(study, options)
    return replace(
        product,
        table=None if product.table is None else _add_factors(product.table, study),
        tables={name: _add_factors(table, study) for name, table in product.tables.items()},
        messages=[*about_mission, *product.messages, *about_robot],
    )


def _add_factors(table: pd.DataFrame, study: Study) -> pd.DataFrame:
    """Insert the factor levels of each row's treatments; add ``factor_`` to a name in use."""
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
