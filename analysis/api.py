"""Figures in scripts and notebooks: the subcommands of ``evoros analyze`` as functions."""

from typing import Any

from evoros.base.errors import InputError

from .robot_choice import make_product
from .subcommands import SUBCOMMANDS, Product, import_subcommand, parse
from .tables.study import Study

OF_COMMAND = {"subcommand", "folders", "where", "treatments", "output", "style", "panel_letters"}
"""Options that choose runs, as the study already does, or that control the written files."""


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
