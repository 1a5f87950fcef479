"""The subcommands of ``evoros-analyze``: names, modules and options.

Modules that draw are imported when their subcommand is chosen.
"""

import argparse
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

from evoros.files.origin import read_origin
from evoros.terminal.arguments import CommandParser

if TYPE_CHECKING:
    from .product import Product
    from .tables.study import Study

NAME = "evoros-analyze"
ABOUT = """evoros-analyze turns the folders of runs and evaluations, or sweeps of them, into figures
and the numbers behind them.

Incomplete or damaged folders are skipped, and each is reported. Exit status: 0 done; 2 input that
cannot be used; 130 interrupted."""

SUBCOMMANDS: Mapping[str, str] = {
    "overlay": ".figures.overlay",
    "panel": ".figures.panel",
    "fitness": ".figures.fitness",
    "failure": ".evo_ros_2018.failure",
    "regions": ".figures.regions",
    "mission": ".figures.mission",
    "course": ".evo_ros_2018.course",
    "compare": ".figures.compare",
    "factors": ".figures.factors",
    "power": ".figures.power",
    "transfer": ".figures.transfer",
    "strategies": ".figures.strategies",
    "claims": ".evo_ros_2018.claims",
    "worst": ".figures.worst",
    "archive": ".figures.archive",
    "front": ".figures.front",
    "paper": ".evo_ros_2018.numbered_figures",
    "report": ".report.page",
    "video": ".video.subcommand",
    "deploy": ".deploy.subcommand",
    "bag": ".bags.bag",
}
"""The module of each subcommand."""
EXPORTS = frozenset({"deploy", "bag", "paper"})
"""The subcommands that have no figure of their own: files for other software, figures of others."""


class Subcommand(Protocol):
    """The module of a subcommand.

    It may also have ``FORMATS``, instead of those of figures, ``OUTPUT``, instead of ``figures``,
    ``ONE_ROBOT`` if it shows one of several robots, ``FIRST_ROBOT`` if that is always the first,
    and ``add_arguments(parser)``.
    """

    HELP: str  # one line

    def make_product(self, study: "Study", options: argparse.Namespace) -> "Product":
        """Make the figure, tables and files for a study."""
        ...


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Parse a subcommand and its options.

    Raises:
        InputError: the subcommand or an option does not exist.
    """
    from .drawing.style import KINDS

    chosen = [name for name in SUBCOMMANDS if name in arguments[:1]]
    parser = CommandParser(NAME, description=ABOUT, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--version", action="version", version=f"{NAME} {read_origin().version}")
    subparsers = parser.add_subparsers(dest="subcommand", metavar="SUBCOMMAND", required=True)
    for name in chosen or SUBCOMMANDS:
        module = import_subcommand(name)
        text = module.HELP.replace("%", "%%")  # argparse formats the help of a subcommand
        subparser = subparsers.add_parser(name, help=text, description=module.HELP)
        _add_common_arguments(subparser, getattr(module, "OUTPUT", "figures"))
        _add_formats(subparser, getattr(module, "FORMATS", KINDS), KINDS)
        if getattr(module, "ONE_ROBOT", False):
            about = "of several robots, this one instead of the first"
            subparser.add_argument("--agent", metavar="NAME", help=about)
        getattr(module, "add_arguments", lambda parser: None)(subparser)
    return parser.parse_args(list(arguments))


def _add_common_arguments(parser: argparse.ArgumentParser, output: str) -> None:
    about = "a run, an evaluation, or a sweep"
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER", help=about)
    about = "only runs with this level, or one of several, of a factor; may be repeated"
    parser.add_argument("--where", action="append", default=[], metavar="FACTOR=LEVEL", help=about)
    about = "names of the treatments, and levels of factors of your own, in YAML"
    parser.add_argument("--treatments", type=Path, metavar="FILE", help=about)
    about = f"where the files go, replacing earlier ones; {output}/ in the first folder"
    parser.add_argument("--output", type=Path, metavar="FOLDER", help=about)


def _add_formats(
    parser: argparse.ArgumentParser, kinds: Sequence[str], figure_kinds: Sequence[str]
) -> None:
    """Add the choice of the format, unless the subcommand has none, and of a figure's look."""
    from .drawing.finish import LETTERS

    if kinds:
        parser.add_argument("--format", choices=kinds, default=kinds[0], help=f"{kinds[0]}")
    if kinds and set(kinds) <= set(figure_kinds):
        about = "the figure's width in columns of a page"
        parser.add_argument("--columns", type=int, choices=(1, 2), help=about)
        about = "a matplotlib style, such as a journal's: fonts, sizes, width of a column"
        parser.add_argument("--style", metavar="FILE", help=about)
        about = "name the panels, and the first one so"
        parser.add_argument("--panel-letters", choices=LETTERS, default="", help=about)


def import_subcommand(name: str) -> Subcommand:
    """Import the module of a subcommand, and matplotlib with it."""
    return cast(Subcommand, import_module(SUBCOMMANDS[name], __package__))


def add_run(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the run whose champion is shown."""
    parser.add_argument("--run", metavar="NAME", help="instead of the best run")


def add_worlds(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the worlds."""
    about = "only this world; may be repeated"
    parser.add_argument("--world", metavar="NAME", action="append", help=about)
