"""A subcommand's section of a report: figure, messages and numbers, or why there are none."""

import argparse
import logging
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from markupsafe import Markup

from evoros.base.errors import InputError, single_line
from evoros.terminal.log import LOGGER, withhold_messages

from ..robot_choice import make_product
from ..subcommands import import_subcommand, parse
from ..tables.study import Study
from .pictures import embed_figure
from .templates import Table, format_table, render

MAX_ROWS = 400
"""Maximum number of rows of a table in the page; longer ones are left to the subcommand."""


FIGURE_OF_PAPER = re.compile(r" \([^()]*Figs?\. [^()]*\)")
"""Where the 2018 paper has such a figure, which readers of another study need not know."""
PAPER = "paper"
"""The word for the 2018 paper's claims."""


@dataclass(frozen=True)
class Section:
    """The content of a section."""

    name: str
    missing: str = ""  # why there is no content
    caption: str = ""
    picture: Markup | None = None
    messages: Sequence[str] = ()
    rows: int = 0  # of the table of numbers
    numbers: Table | None = None  # None: no table, or too many rows
    left_out: Sequence[str] = ()

    def render(self, own_section: bool) -> Markup:
        """Render the section, with a heading unless it is a section of the page."""
        return render("section.html", section=self, own_section=own_section)


def make_section(name: str, study: Study, options: argparse.Namespace) -> Section:
    """Make a subcommand's results with its default options; its error affects it alone."""
    failure = ""
    with withhold_messages() as records:
        try:
            section = _make_section(name, study, options)
        except InputError as error:
            section = Section(name, missing=single_line(error))
        except Exception as error:
            failure = f"cannot be drawn ({type(error).__name__}: {single_line(error)})"
            section = Section(name, missing=f"This {failure}.")
    if failure:
        LOGGER.warning("%s: %s; left out", name, failure)
    left_out = [record.getMessage() for record in records if record.levelno >= logging.WARNING]
    return replace(section, left_out=list(dict.fromkeys(left_out)))


def _make_section(name: str, study: Study, options: argparse.Namespace) -> Section:
    module = import_subcommand(name)
    own_claims = name == "claims" and options.claims != PAPER
    more = ["--claims", options.claims] if own_claims else []
    chosen = parse([name, *map(str, options.folders), *more])
    chosen.output = options.output
    product = make_product(module, study, chosen)
    figure, table = product.figure, product.table
    rows = 0 if table is None else len(table)
    caption = FIGURE_OF_PAPER.sub("", module.HELP)
    return Section(
        name,
        caption=f"{caption[0].upper()}{caption[1:]}.",
        picture=None if figure is None else embed_figure(figure, name),
        messages=product.messages,
        rows=rows,
        numbers=None if table is None or rows > MAX_ROWS else format_table(table),
    )
