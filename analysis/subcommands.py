"""The subcommands of ``evoros-analyze``: their names, their modules and their options.

Light on purpose: nothing that draws is imported before a subcommand is chosen.
"""

import argparse
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, Protocol, cast

from evoros import __version__
from evoros.base.errors import InputError

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
    "failure": ".figures.failure",
    "regions": ".figures.regions",
    "mission": ".figures.mission",
    "compare": ".figures.compare",
    "transfer": ".figures.transfer",
    "strategies": ".figures.strategies",
    "claims": ".figures.claims",
    "report": ".report.page",
    "replay": ".video.replay",
}
"""The module of each subcommand, which is imported when it is needed."""


class Subcommand(Protocol):
    """What a module of a subcommand has; ``arguments`` and ``FORMATS`` it may leave out."""

    HELP: str  # one line

    def product(self, study: "Study", options: argparse.Namespace) -> "Product":
        """What it makes of a study."""
        ...


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message}; see {self.prog} --help")


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """The options of one subcommand: also those that it alone has.

    Raises:
        InputError: there is no such subcommand or option.
    """
    from .drawing.style import KINDS

    chosen = [name for name in SUBCOMMANDS if name in arguments[:1]]
    parser = _Parser(NAME, description=ABOUT, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--version", action="version", version=f"{NAME} {__version__}")
    below = parser.add_subparsers(dest="subcommand", metavar="SUBCOMMAND", required=True)
    for name in chosen or SUBCOMMANDS:
        module = module_of(name)
        each = below.add_parser(name, help=module.HELP, description=module.HELP)
        _add_arguments(each, getattr(module, "FORMATS", KINDS), KINDS)
        getattr(module, "arguments", lambda parser: None)(each)
    return parser.parse_args(list(arguments))


def _add_arguments(
    parser: argparse.ArgumentParser, kinds: Sequence[str], figure_kinds: Sequence[str]
) -> None:
    parser.add_argument(
        "folders", nargs="+", type=Path, metavar="FOLDER", help="a run, an evaluation, or a sweep"
    )
    parser.add_argument(
        "--output",
        type=Path,
        metavar="FOLDER",
        help="where the files go, and replace earlier ones; figures/ in the first folder",
    )
    parser.add_argument("--format", choices=kinds, default=kinds[0], help=f"{kinds[0]}")
    if set(kinds) <= set(figure_kinds):
        parser.add_argument(
            "--columns", type=int, choices=(1, 2), help="how many columns of a page it spans"
        )


def module_of(name: str) -> Subcommand:
    """The module of a subcommand; matplotlib is imported only with it."""
    return cast(Subcommand, import_module(SUBCOMMANDS[name], __package__))
