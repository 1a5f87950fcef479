"""The subcommands of ``evoros analyze``; plotting code is imported only on use."""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

from evoros.base.errors import InputError
from evoros.files.origin import read_origin
from evoros.files.plugins import find_plugins
from evoros.terminal.console import DONE, CommandParser

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from .tables.study import Study


@dataclass(frozen=True, eq=False)
class Product:
    """The result of a subcommand: figure, tables, messages and other files."""

    table: "pd.DataFrame | None" = None  # written to SUBCOMMAND.csv
    figure: "Figure | None" = None  # written to SUBCOMMAND.FORMAT
    messages: Sequence[str] = ()  # lines for standard output
    tables: "Mapping[str, pd.DataFrame]" = field(default_factory=dict)  # more tables by file name
    files: Mapping[str, bytes] = field(default_factory=dict)  # content, keyed by file name
    folder: str = ""  # folder of ``files`` to be replaced as a whole, if any
    status: int = DONE  # exit status of the command, which ``regression`` may change


def to_csv(table: "pd.DataFrame") -> bytes:
    """Return a table as the content of a CSV file."""
    return table.to_csv(index=False, lineterminator="\n").encode()


NAME = "evoros analyze"
ABOUT = """Draw figures of runs, evaluations and sweeps, and write the numbers behind them.

Incomplete or damaged folders are skipped with a message. Exit status: 0 done; 2 invalid
input; 3 or 4 the result of regression; 130 interrupted."""

SUBCOMMANDS: Mapping[str, str] = {
    "overlay": ".figures.overlay",
    "panel": ".figures.panel",
    "fitness": ".figures.fitness",
    "regions": ".figures.regions",
    "mission": ".figures.mission",
    "controls": ".figures.controls",
    "compare": ".figures.compare",
    "factors": ".figures.factors",
    "power": ".figures.power",
    "transfer": ".figures.transfer",
    "regression": ".figures.regression",
    "strategies": ".figures.strategies",
    "claims": ".figures.claims",
    "worst": ".figures.worst",
    "archive": ".figures.archive",
    "front": ".figures.front",
    "report": ".report.page",
    "requirements": ".report.requirements",
} | {name: module for plugin in find_plugins().values() for name, module in plugin.figures.items()}
"""Module of each subcommand; relative to ``evoros.analysis`` if it starts with a dot."""
EXPORTS: frozenset[str] = frozenset().union(*(plugin.exports for plugin in find_plugins().values()))
"""Subcommands that export files for other software instead of drawing figures."""
FIGURE_FORMATS: Mapping[str, str] = {
    "pdf": "text stays text, with embedded fonts",  # the default
    "svg": "letters become outlines, so no font is needed",
    "png": "300 dots per inch",
}


class Subcommand(Protocol):
    """The module of a subcommand; its strings and arguments are the source of ``docs/figures.md``.

    Optional attributes are ``FORMATS`` (default: figure formats), ``OUTPUT`` (default:
    ``figures``), ``ONE_ROBOT`` if the figure shows a robot that the user can choose,
    ``FIRST_ROBOT`` if it always shows the first robot, ``WORST_MISSION`` if it shows the worst
    stored mission of evaluations in a study without runs, and ``add_arguments(parser)``.
    """

    HELP: str  # one line
    NEEDS: str  # completes "Needs ..."
    FILES: Sequence[str]  # names of all files except the picture

    def make_product(self, study: "Study", options: argparse.Namespace) -> "Product":
        """Make the figure, tables and files of a study."""


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Parse a subcommand and its options."""
    _check_order(arguments)
    chosen = [name for name in SUBCOMMANDS if name in arguments[:1]]
    parser = CommandParser(NAME, description=ABOUT, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--version", action="version", version=f"{NAME} {read_origin().version}")
    subparsers = parser.add_subparsers(dest="subcommand", metavar="SUBCOMMAND", required=True)
    for name in chosen or SUBCOMMANDS:
        module = import_subcommand(name)
        text = module.HELP.replace("%", "%%")  # argparse formats help strings with %
        about = f"{module.HELP}. Needs {module.NEEDS}."
        add_all_arguments(subparsers.add_parser(name, help=text, description=about), module)
    options, rest = parser.parse_known_args(list(arguments))
    if rest:
        raise InputError(_explain_unknown(options.subcommand, rest[0]))
    for folder in options.folders:
        if str(folder) in SUBCOMMANDS and not folder.exists():
            raise InputError(
                f"{folder}: the name of a figure, not a folder; draw one figure at a time"
            )
    return options


def _check_order(arguments: Sequence[str]) -> None:
    word, *others = arguments or ["-"]
    if word in SUBCOMMANDS or word.startswith("-"):
        return
    if Path(word).exists() or "/" in word:
        figure = next((text for text in others if text in SUBCOMMANDS), "FIGURE")
        raise InputError(f"{word}: must come after a figure's name; type: {NAME} {figure} {word}")
    close = get_close_matches(word, SUBCOMMANDS, 1)
    fix = f"type: {NAME} {close[0]}" if close else f"choose from {', '.join(SUBCOMMANDS)}"
    raise InputError(f"{word}: not the name of a figure; {fix}")


def _explain_unknown(figure: str, word: str) -> str:
    option = word.partition("=")[0]
    owners = []
    for name in SUBCOMMANDS:
        parser = argparse.ArgumentParser()
        add_all_arguments(parser, import_subcommand(name))
        if any(option in action.option_strings for action in parser._actions):
            owners.append(name)
    if owners:
        return f"{option}: an option of {NAME} {', '.join(owners)}; leave it out for {figure}"
    return f"{word}: not an option of {figure}; see {NAME} {figure} --help"


def add_all_arguments(parser: argparse.ArgumentParser, module: Subcommand) -> None:
    """Add the common arguments, then the arguments of a subcommand."""
    _add_common_arguments(parser, getattr(module, "OUTPUT", "figures"))
    _add_formats(parser, getattr(module, "FORMATS", FIGURE_FORMATS))
    if getattr(module, "ONE_ROBOT", False):
        about = "show this robot instead of the first one"
        parser.add_argument("--agent", metavar="NAME", help=about)
    getattr(module, "add_arguments", lambda parser: None)(parser)


def _add_common_arguments(parser: argparse.ArgumentParser, output: str) -> None:
    about = "a run, an evaluation, or a folder that contains them at any depth, such as a sweep"
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER", help=about)
    about = "only runs with this level of a factor, or with one of LEVEL,LEVEL; may be repeated"
    parser.add_argument("--where", action="append", default=[], metavar="FACTOR=LEVEL", help=about)
    about = "YAML file with names of treatments and additional factors"
    parser.add_argument("--treatments", type=Path, metavar="FILE", help=about)
    about = (
        f"folder for the output; replaces existing files; default: {output}/ in the first folder"
    )
    parser.add_argument("--output", type=Path, metavar="FOLDER", help=about)


def _add_formats(parser: argparse.ArgumentParser, formats: Mapping[str, str]) -> None:
    from .drawing.finish import LETTERS

    if formats:
        about = ", ".join(f"{kind} ({text})" if text else kind for kind, text in formats.items())
        default = next(iter(formats))
        parser.add_argument("--format", choices=formats, default=default, help=about)
    if formats is FIGURE_FORMATS:
        about = "the figure's width in page columns: 3.5 in or 7 in"
        parser.add_argument("--columns", type=int, choices=(1, 2), help=about)
        about = (
            "a matplotlib style file (for example from a journal) or the name of a matplotlib "
            "style; sets fonts, font size (font.size) and column width (figure.figsize), but not "
            "colours"
        )
        parser.add_argument("--style", metavar="FILE", help=about)
        about = "letter the panels, starting with this letter"
        parser.add_argument("--panel-letters", choices=LETTERS, default="", help=about)


def import_subcommand(name: str) -> Subcommand:
    """Import the module of a subcommand, which may import matplotlib."""
    return cast(Subcommand, import_module(SUBCOMMANDS[name], __package__))


def add_run(parser: argparse.ArgumentParser) -> None:
    """Add ``--run``, the run whose champion is shown."""
    parser.add_argument("--run", metavar="NAME", help="this run instead of the best one")


def add_worlds(parser: argparse.ArgumentParser) -> None:
    """Add ``--world``."""
    about = "only this world; may be repeated"
    parser.add_argument("--world", metavar="NAME", action="append", help=about)
