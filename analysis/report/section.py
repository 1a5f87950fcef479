"""A subcommand's part of a report: figure, conclusions and numbers, or why there are none."""

import argparse
import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from html import escape

import pandas as pd

from evoros.base.errors import InputError
from evoros.base.log import LOGGER

from ..subcommands import module_of, parse
from ..tables.study import Study
from .html import bullets, folded, paragraph, picture, table

ROWS = 400
"""Of a table that is put into the page; longer ones are left to the subcommand."""


def chapter(name: str, study: Study, options: argparse.Namespace, own_section: bool) -> str:
    """What a subcommand makes of a study with its own defaults, as HTML.

    A fault of the subcommand costs its part of the page, and not the others.
    """
    broken = ""
    with _heard() as heard:
        try:
            content = _content(name, study, options, own_section)
        except InputError as error:
            content = paragraph(_line(error), "missing")
        except Exception as error:
            broken = f"cannot be drawn ({type(error).__name__}: {_line(error)})"
            content = paragraph(f"This {broken}.", "missing")
    if broken:
        LOGGER.warning("%s: %s; left out", name, broken)
    title = "" if own_section else f"<h3>{escape(name.capitalize())}</h3>\n"
    return f"{title}{content}\n{left_out(heard)}"


def left_out(lines: Sequence[str]) -> str:
    """What was said of what is not in a figure; nothing of nothing."""
    once = list(dict.fromkeys(lines))
    return folded(f"Left out ({len(once)})", bullets(once)) if once else ""


def _content(name: str, study: Study, options: argparse.Namespace, own_section: bool) -> str:
    module = module_of(name)
    own = parse([name, *map(str, options.folders)])
    own.output = options.output
    made = module.product(study, own)
    parts = []
    if made.figure is not None:
        caption = f"{module.HELP[0].upper()}{module.HELP[1:]}."
        drawn = picture(made.figure, name)
        parts.append(f"<figure>{drawn}<figcaption>{escape(caption)}</figcaption></figure>")
    said = bullets(made.said)
    parts.append(
        folded(f"In words ({len(made.said)} lines)", said) if len(made.said) > 12 else said
    )
    if made.table is not None:
        parts.append(_numbers(name, made.table, own_section))
    return "\n".join(filter(None, parts))


def _numbers(name: str, numbers: pd.DataFrame, unfolded: bool) -> str:
    if len(numbers) > ROWS:
        return paragraph(f"{len(numbers)} rows of numbers: evoros-analyze {name} FOLDER", "quiet")
    return folded(f"Numbers ({len(numbers)} rows)", table(numbers), unfolded)


@contextmanager
def _heard() -> Iterator[list[str]]:
    """What is said of what is left out meanwhile; it goes into the page, and not elsewhere."""
    lines: list[str] = []

    def keep(record: logging.LogRecord) -> bool:
        lines.append(record.getMessage())
        return False

    LOGGER.addFilter(keep)
    try:
        yield lines
    finally:
        LOGGER.removeFilter(keep)


def _line(error: Exception) -> str:
    return " ".join(str(error).split())
